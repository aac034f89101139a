//! Border columns and rows that are empty in all views because the sensor does not fill its image. A
//! Kinect v1 leaves eight columns on the right empty, which no matching window reaches.

use super::field::Field;
use super::tiles::SIDE;
use crate::terms::PixelContext;

/// First and last column, and first and last row, with measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Margins {
    columns: [usize; 2],
    rows: [usize; 2],
    size: [usize; 2],
}

/// Least number of target readings, all missing, for a line to count as empty. With nine in ten readings lost
/// for another reason, one such line in 10^4 would count.
const ASKED: usize = 100;
/// Widest margin of a sensor, as a share of the picture; a wider one is reported as a loss.
const WIDEST: f64 = 1.0 / 16.0;

impl Margins {
    pub fn of(fields: &[Field]) -> Self {
        let size = fields.first().map_or([0, 0], |f| [f.width, f.height]);
        let mut lines = size.map(|n| vec![[0usize; 2]; n]);
        for f in fields {
            for (&i, &measured) in f.pixels.iter().zip(&f.measured) {
                let place = [i as usize % f.width, i as usize / f.width];
                for (line, at) in lines.iter_mut().zip(place) {
                    line[at][0] += f.frames.len();
                    line[at][1] += usize::from(measured);
                }
            }
        }
        let [columns, rows] = lines.map(|line| seen(&line));
        Margins { columns, rows, size }
    }

    /// Whether the whole tile at this place lies where the sensor measures.
    pub fn hold(&self, place: &PixelContext) -> bool {
        let half = 0.5 * SIDE as f64;
        let inside = |at: f64, [first, last]: [usize; 2]| {
            at - half >= first as f64 - 1.0 && at + half <= last as f64 + 1.0
        };
        inside(place.u, self.columns) && inside(place.v, self.rows)
    }

    /// Whether the pixel lies where the sensor measures.
    pub fn hold_pixel(&self, column: usize, row: usize) -> bool {
        let inside = |at: usize, [first, last]: [usize; 2]| (first..=last).contains(&at);
        inside(column, self.columns) && inside(row, self.rows)
    }

    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (what, [first, last], n) in
            [("column", self.columns, self.size[0]), ("row", self.rows, self.size[1])]
        {
            for (from, to) in [(0, first), (last + 1, n)].into_iter().filter(|(a, b)| a < b) {
                notes.push(format!(
                    "{what}s {from} to {} answer in no view: the sensor sees less than its image has room for, and they count for no loss",
                    to - 1
                ));
            }
        }
        notes
    }
}

/// First and last line with measurements, from the readings asked for and measured in each.
fn seen(lines: &[[usize; 2]]) -> [usize; 2] {
    let n = lines.len();
    let empty = |line: &&[usize; 2]| line[0] >= ASKED && line[1] == 0;
    let widest = (WIDEST * n as f64) as usize;
    let allowed = |margin: usize| if margin > widest { 0 } else { margin };
    let first = allowed(lines.iter().take_while(empty).count());
    let last = allowed(lines.iter().rev().take_while(empty).count());
    [first, n.saturating_sub(1 + last)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_lines_at_the_border_are_no_part_of_the_picture() {
        let mut lines = vec![[500, 480]; 160];
        lines[152..].fill([500, 0]);
        assert_eq!(seen(&lines), [0, 151]);
        lines[80] = [500, 0];
        assert_eq!(seen(&lines), [0, 151], "a dead line in the middle is a loss");
        lines[155] = [500, 1];
        assert_eq!(seen(&lines), [0, 155], "from the border inwards, as long as nothing answers");
        lines[120..].fill([500, 0]);
        assert_eq!(seen(&lines), [0, 159], "a quarter of the picture is no margin");
        assert_eq!(seen(&vec![[99, 0]; 160]), [0, 159], "too little was asked");
        assert_eq!(seen(&[]), [0, 0]);
    }
}
