//! Pages of documentation, with nothing to call: what the files mean and what the code rests on.

#[doc = include_str!("catalogue.md")]
pub mod catalogue {}

#[doc = include_str!("layouts.md")]
pub mod layouts {}

#[doc = include_str!("capture.md")]
pub mod capture {}

#[doc = include_str!("identifiability.md")]
pub mod identifiability {}

#[doc = include_str!("engine.md")]
pub mod engine {}

#[cfg(test)]
mod tests {
    use crate::effects::{CATALOGUE, Card, Parameter};
    use crate::measure::write_measurements;

    fn knob(p: &Parameter) -> String {
        let unit = if p.unit().is_empty() { String::new() } else { format!(" {}", p.unit()) };
        format!("`{}` ({}{unit})", p.name, p.typical)
    }

    fn row(card: &Card) -> String {
        let knobs: Vec<String> = card.parameters.iter().map(knob).collect();
        let Card { id, statistic, axis, summary, .. } = card;
        format!("| `{id}` | {statistic} | {axis} | {summary} | {} |\n", knobs.join(", "))
    }

    #[test]
    fn the_catalogue_is_the_one_in_the_code() {
        let rows: String = CATALOGUE.iter().map(|e| row(e.card())).collect();
        let page = include_str!("catalogue.md");
        assert!(page.contains(&rows), "put these rows into src/docs/catalogue.md:\n{rows}");
    }

    #[test]
    fn the_columns_of_the_measurements_are_the_ones_in_the_code() {
        let page = include_str!("layouts.md");
        let (_, section) = page.split_once("# measurements.csv").expect("the section");
        let rows = section.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
        let header = write_measurements(&[]);
        let columns: Vec<&str> = header.trim_end().split(',').collect();
        assert_eq!(rows.take(columns.len()).collect::<Vec<_>>(), columns);
    }
}
