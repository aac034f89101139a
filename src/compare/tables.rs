//! The paper's Tables III to VI, as text and as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{Comparison, Row, Run};
use crate::evaluate::Spread;

/// What a table shows of a run.
struct Table {
    title: &'static str,
    of: fn(&Run) -> Spread,
    still: fn(&Comparison) -> Spread,
}

const TABLES: [Table; 3] = [
    Table {
        title: "Table III. Absolute trajectory error after alignment (mm)",
        of: |r| r.evaluation.ate.error.scaled(1e3),
        still: |c| c.still.ate.error.scaled(1e3),
    },
    Table {
        title: "Table IV. Relative pose error over 1 s, translation (mm)",
        of: |r| r.evaluation.rpe.translation.scaled(1e3),
        still: |c| c.still.rpe.translation.scaled(1e3),
    },
    Table {
        title: "Table V. Relative pose error over 1 s, rotation (degrees)",
        of: |r| r.evaluation.rpe.rotation.scaled(180.0 / std::f64::consts::PI),
        still: |c| c.still.rpe.rotation.scaled(180.0 / std::f64::consts::PI),
    },
];

const HEAD: [&str; 6] = ["rmse", "mean", "median", "std", "min", "max"];

/// All four, as text; with repeats, means over the runs, and the rmse's standard deviation.
pub fn tables(comparison: &Comparison) -> String {
    let mut text = format!("{}\n", comparison.sequence);
    for table in &TABLES {
        let _ = writeln!(text, "\n{}\n{}", table.title, header(&HEAD));
        for row in &comparison.rows {
            let _ = writeln!(text, "{}", line(row, table.of));
        }
        let still = (table.still)(comparison);
        let _ = writeln!(text, "{:<30}{}", "(a camera that stands still)", figures(&still));
    }
    let _ = writeln!(
        text,
        "\nTable VI. Work per frame\n{}",
        header(&["iterations", "ms", "lost", "frames"])
    );
    for row in &comparison.rows {
        let _ = match row.runs.first() {
            Some(run) => writeln!(
                text,
                "{:<30}{:>11.1}{:>11.1}{:>11}{:>11}",
                row.variant.name,
                run.iterations,
                run.stages.total(),
                run.lost,
                run.frames
            ),
            None => writeln!(text, "{:<30}{}", row.variant.name, why(row)),
        };
    }
    text
}

fn header(columns: &[&str]) -> String {
    columns.iter().fold(" ".repeat(30), |line, c| format!("{line}{c:>11}"))
}

fn line(row: &Row, of: fn(&Run) -> Spread) -> String {
    let spreads: Vec<Spread> = row.runs.iter().map(of).collect();
    if spreads.is_empty() {
        return format!("{:<30}{}", row.variant.name, why(row));
    }
    let n = spreads.len() as f64;
    let mean = |f: fn(&Spread) -> f64| spreads.iter().map(f).sum::<f64>() / n;
    let middle = Spread {
        rmse: mean(|s| s.rmse),
        mean: mean(|s| s.mean),
        median: mean(|s| s.median),
        std: mean(|s| s.std),
        min: mean(|s| s.min),
        max: mean(|s| s.max),
        pairs: spreads[0].pairs,
    };
    let mut text = format!("{:<30}{}", row.variant.name, figures(&middle));
    if spreads.len() > 1 {
        let squares = spreads.iter().map(|s| (s.rmse - middle.rmse).powi(2)).sum::<f64>();
        let _ =
            write!(text, "   ± {:.3} over {} runs", (squares / (n - 1.0)).sqrt(), spreads.len());
    }
    text
}

fn figures(s: &Spread) -> String {
    [s.rmse, s.mean, s.median, s.std, s.min, s.max]
        .iter()
        .fold(String::new(), |line, v| format!("{line}{v:>11.3}"))
}

fn why(row: &Row) -> String {
    format!("  no figures: {}", row.failed.as_deref().unwrap_or("it was not run"))
}

/// Everything with full digits, SI.
pub fn as_json(comparison: &Comparison) -> Value {
    let spread = |s: &Spread| {
        json!({"rmse": s.rmse, "mean": s.mean, "median": s.median, "std": s.std,
            "min": s.min, "max": s.max, "pairs": s.pairs})
    };
    let run = |r: &Run| {
        let ms: serde_json::Map<String, Value> =
            r.stages.each().map(|(name, ms)| (name.into(), json!(ms))).collect();
        json!({
            "seed": r.seed,
            "ate_m": spread(&r.evaluation.ate.error),
            "rpe_translation_m": spread(&r.evaluation.rpe.translation),
            "rpe_rotation_rad": spread(&r.evaluation.rpe.rotation),
            "iterations": r.iterations,
            "lost": r.lost,
            "frames": r.frames,
            "ms": ms,
        })
    };
    let row = |r: &Row| {
        json!({
            "variant": r.variant.name,
            "of_the_paper": r.variant.of_the_paper,
            "settings": format!("{:?}", r.variant.options),
            "runs": r.runs.iter().map(run).collect::<Vec<Value>>(),
            "failed": r.failed,
        })
    };
    json!({
        "sequence": comparison.sequence,
        "rows": comparison.rows.iter().map(row).collect::<Vec<Value>>(),
        "still": {
            "ate_m": spread(&comparison.still.ate.error),
            "rpe_translation_m": spread(&comparison.still.rpe.translation),
            "rpe_rotation_rad": spread(&comparison.still.rpe.rotation),
        },
        "remarks": comparison.remarks,
    })
}
