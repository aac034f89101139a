//! The paper's Tables III to VI, as text and as JSON.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::{Comparison, Row, Run};
use crate::evaluate::{Evaluation, Spread};

/// The error statistics that a table shows.
type Column = fn(&Evaluation) -> Spread;

const TABLES: [(&str, Column); 3] = [
    ("Table III. Absolute trajectory error after alignment (mm)", |e| e.ate.error.scaled(1e3)),
    ("Table IV. Relative pose error over 1 s, translation (mm)", |e| e.rpe.translation.scaled(1e3)),
    ("Table V. Relative pose error over 1 s, rotation (degrees)", |e| {
        e.rpe.rotation.scaled(180.0 / std::f64::consts::PI)
    }),
];

/// One of the four tables, with a row for each variant.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    pub title: &'static str,
    /// Column titles and decimals.
    pub columns: Vec<(&'static str, usize)>,
    pub rows: Vec<TableRow>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct TableRow {
    pub name: &'static str,
    /// Empty if the variant has no run.
    pub figures: Vec<f64>,
    /// Empty if there is nothing to add.
    pub remark: String,
}

/// All four tables. With repeats, Tables III to V show means over the runs and the standard deviation of the
/// rmse; Table VI shows the first run.
pub fn tables(comparison: &Comparison) -> Vec<Table> {
    let mut tables: Vec<Table> = TABLES
        .iter()
        .map(|(title, of)| {
            let mut rows: Vec<TableRow> = comparison.rows.iter().map(|r| spreads(r, *of)).collect();
            let (name, remark) = ("(a camera that stands still)", String::new());
            let still = of(&comparison.still).figures();
            rows.push(TableRow { name, figures: still.map(|(_, v)| v).into(), remark });
            Table { title, columns: still.map(|(name, _)| (name, 3)).into(), rows }
        })
        .collect();
    let work = |row: &Row| match row.runs.first() {
        Some(run) => {
            let figures =
                vec![run.iterations, run.stages.total(), run.lost as f64, run.frames as f64];
            TableRow { name: row.variant.name, figures, remark: String::new() }
        }
        None => TableRow { name: row.variant.name, figures: Vec::new(), remark: failure(row) },
    };
    tables.push(Table {
        title: "Table VI. Work per frame",
        columns: vec![("iterations", 1), ("ms", 1), ("lost", 0), ("frames", 0)],
        rows: comparison.rows.iter().map(work).collect(),
    });
    tables
}

/// All four tables as text.
pub fn text(comparison: &Comparison) -> String {
    // A sequence name may be anything, but must not add lines.
    let mut text = format!("{}\n", comparison.sequence.replace(char::is_control, "?"));
    for table in tables(comparison) {
        let header: String = table.columns.iter().map(|(c, _)| format!("{c:>11}")).collect();
        // Writing to a String does not fail.
        let _ = writeln!(text, "\n{}\n{}{header}", table.title, " ".repeat(30));
        for row in table.rows {
            let figures = row.figures.iter().zip(&table.columns);
            let figures: String =
                figures.map(|(v, (_, d))| format!("{v:>11.d$}", d = *d)).collect();
            let _ = writeln!(text, "{:<30}{figures}{}", row.name, row.remark);
        }
    }
    text
}

fn spreads(row: &Row, of: Column) -> TableRow {
    let spreads: Vec<Spread> = row.runs.iter().map(|r| of(&r.evaluation)).collect();
    let name = row.variant.name;
    if spreads.is_empty() {
        return TableRow { name, figures: Vec::new(), remark: failure(row) };
    }
    let n = spreads.len() as f64;
    let mean = |k: usize| spreads.iter().map(|s| s.figures()[k].1).sum::<f64>() / n;
    let means: Vec<f64> = (0..6).map(mean).collect();
    let mut remark = String::new();
    if spreads.len() > 1 {
        let squares = spreads.iter().map(|s| (s.rmse - means[0]).powi(2)).sum::<f64>();
        let deviation = (squares / (n - 1.0)).sqrt();
        remark = format!("   ± {deviation:.3} over {} runs", spreads.len());
    }
    if let Some(why) = row.failed.last() {
        let told = match row.failed.len() {
            1 => "one failed".to_string(),
            n => format!("{n} failed, the last"),
        };
        remark += &format!("   {told}: {}", why.replace(char::is_control, "?"));
    }
    TableRow { name, figures: means, remark }
}

fn failure(row: &Row) -> String {
    let why = row.failed.last().map_or("it was not run", String::as_str);
    format!("  no figures: {}", why.replace(char::is_control, "?"))
}

/// All results at full precision, in SI units.
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
    let figures = [
        ("ate_m", e.ate.error.json("")),
        ("rpe_translation_m", e.rpe.translation.json("")),
        ("rpe_rotation_rad", e.rpe.rotation.json("")),
    ];
    figures.map(|(name, value)| (name.to_string(), value)).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::compare::of_the_paper;
    use crate::evaluate::{Delta, evaluate};
    use crate::map::Stages;
    use crate::trajectory::Pose;

    #[test]
    fn the_table_counts_the_failures_and_the_json_has_them_all() {
        let at = |k: u8| {
            let t = f64::from(k);
            Pose { stamp: t, world_from_camera: Isometry3::translation(t, t * t, 0.0) }
        };
        let truth: Vec<Pose> = (0..5).map(at).collect();
        let still = evaluate(&truth, &truth, Delta::Seconds(1.0)).expect("evaluated");
        let run = Run {
            seed: 1,
            evaluation: still.clone(),
            iterations: 3.0,
            lost: 0,
            frames: truth.len(),
            stages: Stages::default(),
            trajectory: truth.clone(),
        };
        let failed = ["a.png: cut", "b.png: cut"].map(String::from).to_vec();
        let row = Row { variant: of_the_paper()[2], runs: vec![run], failed: failed.clone() };
        let rows = vec![row];
        let all = Comparison { sequence: "desk".into(), rows, still, truth, remarks: Vec::new() };
        let text = text(&all);
        assert_eq!(text.matches("2 failed, the last: b.png: cut").count(), TABLES.len(), "{text}");
        assert_eq!(json(&all)["rows"][0]["failed"], json!(failed));
    }
}
