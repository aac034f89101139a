//! A finding's curve: measured points with error bars, and the extended model's line.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use crate::diagnose::Curve;
use crate::error::Result;
use crate::report::axis::Axis;
use crate::report::colours::{FAINT, INK};
use crate::report::sheet::{self, Drawing, Drawn, SMALL, Sheet, TEXT};

const WIDTH: u32 = 470;
const HEIGHT: u32 = 290;
const LEFT: i32 = 10;
const RIGHT: i32 = 22;
const TOP: i32 = 40;
/// Half the width of an error bar's ends, and the radius of a point, units.
const CAP: i32 = 3;
const DOT: i32 = 4;
/// With more points than this they shrink.
const MANY: usize = 40;
/// Share of the range left free above and below.
const MARGIN: f64 = 0.06;
/// A bar longer than this many times the curve's height does not set the scale.
const LONGEST_BAR: f64 = 1.5;
/// Zero belongs into the picture when it is no farther than this many times the curve's height.
const FARTHEST_ZERO: f64 = 0.6;
/// The page's accent.
const LINE: RGBColor = RGBColor(0x1d, 0x91, 0xc0);

/// Everything the picture shows, in order of x.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CurveFigure {
    x_label: String,
    y_label: String,
    x: Axis,
    y: Axis,
    /// x, y and its standard error.
    points: Vec<[f64; 3]>,
    line: Vec<[f64; 2]>,
}

impl CurveFigure {
    /// `None` where there is nothing to be seen.
    pub fn of(curve: &Curve) -> Option<Self> {
        let at = |values: &[f64], i: usize| values.get(i).copied().unwrap_or(f64::NAN);
        let mut points = Vec::new();
        let mut line = Vec::new();
        for (i, &x) in curve.x.iter().enumerate().filter(|(_, x)| x.is_finite()) {
            if at(&curve.y, i).is_finite() {
                points.push([x, curve.y[i], at(&curve.y_std_error, i)]);
            }
            if at(&curve.model, i).is_finite() {
                line.push([x, curve.model[i]]);
            }
        }
        points.sort_by(|a, b| a[0].total_cmp(&b[0]));
        line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let xs = range(points.iter().map(|p| p[0]).chain(line.iter().map(|p| p[0])))?;
        let ys = heights(&points, &line)?;
        Some(CurveFigure {
            x_label: curve.x_label.clone(),
            y_label: curve.y_label.clone(),
            x: roomy(xs),
            y: roomy(ys),
            points,
            line,
        })
    }

    pub fn svg(&self) -> Result<String> {
        sheet::svg(self)
    }
}

fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let [low, high] =
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
    (low <= high).then_some([low, high])
}

/// Points, line, zero where it is near, and what of the error bars does not dwarf them.
fn heights(points: &[[f64; 3]], line: &[[f64; 2]]) -> Option<[f64; 2]> {
    let values = points.iter().map(|p| p[1]).chain(line.iter().map(|p| p[1]));
    let [low, high] = range(values)?;
    let far = FARTHEST_ZERO * (high - low);
    let zero = (low <= far && high >= -far).then_some(0.0);
    let [low, high] = range([low, high].into_iter().chain(zero))?;
    let longest = LONGEST_BAR * (high - low);
    let bars = points.iter().filter(|p| p[2] <= longest || longest == 0.0);
    let ends = bars.flat_map(|p| [p[1] - p[2], p[1] + p[2]]).filter(|v| v.is_finite());
    range(ends.chain([low, high]))
}

fn roomy([low, high]: [f64; 2]) -> Axis {
    let spare = MARGIN * (high - low);
    let mut axis = Axis::linear(low - spare, high + spare);
    // Half as many labels are enough for a small picture.
    if axis.ticks.len() > 6 {
        let step = axis.ticks[1] - axis.ticks[0];
        axis.ticks.retain(|t| ((t / step).round() as i64) % 2 == 0);
    }
    axis
}

impl Drawing for CurveFigure {
    const WHAT: &'static str = "a finding's curve";
    const SIZE: (u32, u32) = (WIDTH, HEIGHT);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        let top = (sheet.px(LEFT), sheet.px(TOP / 2));
        sheet.text(&self.y_label, top, self.fitting(sheet, &self.y_label)?, HPos::Left)?;
        let [top, bottom, left, right] = [TOP, 8, LEFT, RIGHT].map(|u| sheet.px(u));
        let area = sheet.root.margin(top, bottom, left, right);
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(46))
            .y_label_area_size(sheet.px(52))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        sheet
            .mesh(&mut chart, SMALL)
            .set_all_tick_mark_size(sheet.px(4))
            .axis_desc_style(sheet.font(self.fitting(sheet, &self.x_label)?).color(&INK))
            .x_desc(self.x_label.as_str())
            .draw()?;
        let at = |x: f64, y: f64| chart.backend_coord(&(x, y.clamp(self.y.low, self.y.high)));
        if self.y.contains(0.0) {
            let zero = [at(self.x.low, 0.0), at(self.x.high, 0.0)];
            sheet.line(&zero, sheet.stroke(&FAINT, 1), &[5, 4])?;
        }
        let line: Vec<_> = self.line.iter().map(|p| at(p[0], p[1])).collect();
        sheet.line(&line, sheet.stroke(&LINE, 3), &[])?;
        let ink = sheet.stroke(&INK, 1);
        let dot = sheet.px(if self.points.len() > MANY { DOT / 2 } else { DOT });
        for &[x, y, error] in &self.points {
            if error.is_finite() {
                let [low, high] = [at(x, y - error), at(x, y + error)];
                sheet.line(&[low, high], ink, &[])?;
                for (x, y) in [low, high] {
                    sheet.line(&[(x - sheet.px(CAP), y), (x + sheet.px(CAP), y)], ink, &[])?;
                }
            }
            sheet.root.draw(&Circle::new(at(x, y), dot, INK.filled()))?;
        }
        Ok(())
    }
}

impl CurveFigure {
    /// The size at which a label is no wider than the picture.
    fn fitting<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, text: &str) -> Drawn<B, i32> {
        let room = sheet.px(WIDTH as i32 - 2 * LEFT - RIGHT);
        let needed = sheet.width(text, TEXT)?.max(1);
        Ok(if needed > room { (TEXT * room / needed).max(SMALL / 2) } else { TEXT })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_wild_bars_do_not_spoil_the_scale() {
        let curve = Curve {
            x: vec![3.0, 1.0, 2.0, f64::NAN],
            y: vec![0.3, 0.1, f64::NAN, 1.0],
            y_std_error: vec![0.01, 90.0, 0.01],
            model: vec![0.3, 0.1, 0.2],
            ..Default::default()
        };
        let figure = CurveFigure::of(&curve).unwrap();
        assert_eq!(figure.points.len(), 2);
        assert_eq!(figure.line, [[1.0, 0.1], [2.0, 0.2], [3.0, 0.3]]);
        assert!(figure.y.high < 0.4 && figure.y.low <= 0.0);
        assert!(figure.svg().is_ok());
        assert_eq!(CurveFigure::of(&Curve::default()), None);
    }
}
