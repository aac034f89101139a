//! The paper's Tables III to VI, as text and as JSON.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::{Comparison, Row, Run};
use crate::evaluate::{Evaluation, Spread};

/// What a table shows of an evaluation.
type Column = fn(&Evaluation) -> Spread;

const TABLES: [(&str, Column); 3] = [
    ("Table III. Absolute trajectory error after alignment (mm)", |e| e.ate.error.scaled(1e3)),
    ("Table IV. Relative pose error over 1 s, translation (mm)", |e| e.rpe.translation.scaled(1e3)),
    ("Table V. Relative pose error over 1 s, rotation (degrees)", |e| {
        e.rpe.rotation.scaled(180.0 / std::f64::consts::PI)
    }),
];

/// All four, as text; with repeats, means over the runs, and the rmse's standard deviation.
pub fn text(comparison: &Comparison) -> String {
    let mut text = format!("{}\n", comparison.sequence);
    // Writing to a String does not fail.
    let _ = write_tables(&mut text, comparison);
    text
}

fn write_tables(text: &mut String, comparison: &Comparison) -> std::fmt::Result {
    for (title, of) in &TABLES {
        let header = header(["rmse", "mean", "median", "std", "min", "max"]);
        writeln!(text, "\n{title}\n{header}")?;
        for row in &comparison.rows {
            writeln!(text, "{:<30}{}", row.variant.name, spreads(row, *of))?;
        }
        let still = figures(&of(&comparison.still));
        writeln!(text, "{:<30}{still}", "(a camera that stands still)")?;
    }
    let header = header(["iterations", "ms", "lost", "frames"]);
    writeln!(text, "\nTable VI. Work per frame\n{header}")?;
    for row in &comparison.rows {
        let work = row.runs.first().map(|run| {
            let ms = run.stages.total();
            format!("{:>11.1}{ms:>11.1}{:>11}{:>11}", run.iterations, run.lost, run.frames)
        });
        writeln!(text, "{:<30}{}", row.variant.name, work.unwrap_or_else(|| failure(row)))?;
    }
    Ok(())
}

fn header<const N: usize>(columns: [&str; N]) -> String {
    " ".repeat(30) + &columns.map(|c| format!("{c:>11}")).concat()
}

fn spreads(row: &Row, of: Column) -> String {
    let spreads: Vec<Spread> = row.runs.iter().map(|r| of(&r.evaluation)).collect();
    if spreads.is_empty() {
        return failure(row);
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
    let mut text = figures(&middle);
    if spreads.len() > 1 {
        let squares = spreads.iter().map(|s| (s.rmse - middle.rmse).powi(2)).sum::<f64>();
        let deviation = (squares / (n - 1.0)).sqrt();
        text += &format!("   ± {deviation:.3} over {} runs", spreads.len());
    }
    text
}

fn figures(s: &Spread) -> String {
    [s.rmse, s.mean, s.median, s.std, s.min, s.max].map(|v| format!("{v:>11.3}")).concat()
}

fn failure(row: &Row) -> String {
    format!("  no figures: {}", row.failed.as_deref().unwrap_or("it was not run"))
}

/// Everything with full digits, SI.
pub fn json(comparison: &Comparison) -> Value {
    let run = |r: &Run| {
        let mut object = Map::new();
        object.insert("seed".into(), json!(r.seed));
        object.extend(evaluation(&r.evaluation));
        object.insert("iterations".into(), json!(r.iterations));
        object.insert("lost".into(), json!(r.lost));
        object.insert("frames".into(), json!(r.frames));
        let ms: Map<String, Value> =
            r.stages.each().map(|(name, ms)| (name.into(), json!(ms))).collect();
        object.insert("ms".into(), ms.into());
        Value::Object(object)
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
        "still": evaluation(&comparison.still),
        "remarks": comparison.remarks,
    })
}

fn evaluation(e: &Evaluation) -> Map<String, Value> {
    let spread = |s: &Spread| {
        json!({"rmse": s.rmse, "mean": s.mean, "median": s.median, "std": s.std,
            "min": s.min, "max": s.max, "pairs": s.pairs})
    };
    let figures = [
        ("ate_m", spread(&e.ate.error)),
        ("rpe_translation_m", spread(&e.rpe.translation)),
        ("rpe_rotation_rad", spread(&e.rpe.rotation)),
    ];
    figures.map(|(name, value)| (name.to_string(), value)).into_iter().collect()
}
