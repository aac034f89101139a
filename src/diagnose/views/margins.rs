//! Border columns and rows that are empty in all views because the sensor does not fill its image. A
//! Kinect v1 leaves eight columns on the right empty, which no matching window reaches. A target's region
//! may end within them, so that the outermost lines are not asked for at all.

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

/// What one line of the picture shows in all views.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    /// Readings of the targets that it should hold, and the number of views that ask for any.
    asked: usize,
    asking: usize,
    /// Readings of the targets, and of the whole of each first picture; and the number of views that have any.
    measured: usize,
    answering: usize,
}

/// Least number of target readings, all missing, for the lines at a border to count as empty. With nine in ten
/// readings lost for another reason, this happens once in 10^4. Also the least number of readings on the first
/// line that answers, for the border of the sensor's picture to be there.
const READINGS: usize = 100;
/// Least number of views for either: one alone may have lost a line for a reason of its own.
const VIEWS: usize = 2;
/// Widest margin of a sensor, as a share of the picture; a wider one is reported as a loss.
const WIDEST: f64 = 1.0 / 16.0;

impl Margins {
    pub fn of(fields: &[Field]) -> Self {
        let size = fields.first().map_or([0, 0], |f| [f.width, f.height]);
        let mut lines = size.map(|n| vec![Line::default(); n]);
        for f in fields {
            let pictured = |&n: &u32| Line { measured: n as usize, ..Line::default() };
            let mut own = f.pictured.each_ref().map(|n| n.iter().map(pictured).collect::<Vec<_>>());
            for (&i, &measured) in f.pixels.iter().zip(&f.measured) {
                let place = [i as usize % f.width, i as usize / f.width];
                for (lines, at) in own.iter_mut().zip(place) {
                    lines[at].asked += f.frames.len();
                    lines[at].measured += usize::from(measured);
                }
            }
            for (line, own) in lines.iter_mut().flatten().zip(own.iter().flatten()) {
                line.asked += own.asked;
                line.asking += usize::from(own.asked > 0);
                line.measured += own.measured;
                line.answering += usize::from(own.measured > 0);
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

/// First and last line with measurements.
fn seen(lines: &[Line]) -> [usize; 2] {
    let n = lines.len();
    let widest = (WIDEST * n as f64) as usize;
    let allowed = |margin: usize| if margin > widest { 0 } else { margin };
    let first = allowed(margin(lines.iter()));
    let last = allowed(margin(lines.iter().rev()));
    [first, n.saturating_sub(1 + last)]
}

/// Lines from the border inwards, up to the last that is asked for before the first with a measurement; none where
/// too little was asked to tell, unless the first that answers does so in many places.
fn margin<'a>(inwards: impl Iterator<Item = &'a Line> + Clone) -> usize {
    let silent = || inwards.clone().take_while(|line| line.measured == 0);
    let first = inwards.clone().nth(silent().count());
    let ends = first.is_some_and(|line| line.measured >= READINGS && line.answering >= VIEWS);
    let mut asked = 0;
    let empty = |line: &Line| {
        asked += line.asked;
        line.asked > 0 && (ends || asked >= READINGS && line.asking >= VIEWS)
    };
    let of_lines: Vec<bool> = silent().map(empty).collect();
    of_lines.iter().rposition(|empty| *empty).map_or(0, |at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(asked: usize, measured: usize) -> Line {
        Line { asked, measured, asking: VIEWS, answering: VIEWS }
    }

    #[test]
    fn empty_lines_at_the_border_are_no_part_of_the_picture() {
        let mut lines = vec![line(500, 480); 160];
        lines[152..].fill(line(500, 0));
        assert_eq!(seen(&lines), [0, 151]);
        lines[80] = line(500, 0);
        assert_eq!(seen(&lines), [0, 151], "a dead line in the middle is a loss");
        lines[155] = line(500, 1);
        assert_eq!(seen(&lines), [0, 155], "from the border inwards, as long as nothing answers");
        lines[120..].fill(line(500, 0));
        assert_eq!(seen(&lines), [0, 159], "a quarter of the picture is no margin");
        assert_eq!(seen(&vec![line(99, 0); 160]), [0, 159], "too little was asked");
        assert_eq!(seen(&[]), [0, 0]);
    }

    #[test]
    fn a_region_may_end_within_the_margin() {
        let mut lines = vec![line(500, 480); 160];
        lines[..2].fill(line(0, 0));
        assert_eq!(seen(&lines), [0, 159], "not asked for, so nothing is known");
        lines[2] = line(500, 0);
        assert_eq!(seen(&lines), [3, 159]);
    }

    /// A polygon cut by the picture's border asks for a few pixels of each line, in one view or in some.
    #[test]
    fn the_corners_of_regions_ask_for_little_of_each_line() {
        let mut lines = vec![line(500, 480); 160];
        for (row, asked) in [76, 38, 8].into_iter().enumerate() {
            lines[157 + row] = line(asked, 0);
        }
        assert_eq!(seen(&lines), [0, 156], "beside a line that answers");
        lines[156] = line(80, 1);
        assert_eq!(seen(&lines), [0, 156], "a hundred readings together");
        lines[157] = line(10, 0);
        assert_eq!(seen(&lines), [0, 159], "too little was asked");
        lines[156] = line(500, 480);
        lines[157..].iter_mut().for_each(|line| line.asking = 1);
        assert_eq!(seen(&lines), [0, 156], "one view asks, and many places beside it answer");
        lines[156].answering = 1;
        assert_eq!(seen(&lines), [0, 159], "one view alone has both");
    }
}
