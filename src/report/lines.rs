//! Lines over two axes, with a legend on the right.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::axis::Axis;
use super::colours::INK;
use super::sheet::{self, Drawing, Drawn, SMALL, Sheet, TEXT};
use crate::error::Result;

/// A line by name.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub name: String,
    pub points: Vec<[f64; 2]>,
    /// Drawn black and thin, below the others.
    pub is_truth: bool,
}

/// What stands where.
#[derive(Debug, Clone, PartialEq)]
pub struct LineFigure {
    pub title: String,
    pub x_label: String,
    pub y_label: String,
    pub lines: Vec<Line>,
    x: Axis,
    y: Axis,
}

const WIDTH: u32 = 980;
const HEIGHT: u32 = 560;
const LEGEND: i32 = 235;
const LEFT: i32 = 70;
const BOTTOM: i32 = 50;
const TOP: i32 = 44;
/// Room around the lines, share of their extent.
const MARGIN: f64 = 0.04;
/// ColorBrewer's Dark2 and two of Set1: told apart by colour-blind eyes, four at least in print.
const COLOURS: [RGBColor; 8] = [
    RGBColor(217, 95, 2),
    RGBColor(117, 112, 179),
    RGBColor(230, 171, 2),
    RGBColor(27, 158, 119),
    RGBColor(231, 41, 138),
    RGBColor(55, 126, 184),
    RGBColor(102, 166, 30),
    RGBColor(166, 118, 29),
];

impl LineFigure {
    /// Axes as the lines need them; `equal` when both are lengths of one plane.
    pub fn new(title: &str, [x_label, y_label]: [&str; 2], lines: Vec<Line>, equal: bool) -> Self {
        let range = |k: usize| {
            let all = || lines.iter().flat_map(|l| &l.points).map(|p| p[k]);
            let (low, high) =
                (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
            if low.is_finite() && high.is_finite() { [low, high] } else { [0.0, 1.0] }
        };
        let (mut x, mut y) = (range(0), range(1));
        if equal {
            let inner =
                [f64::from(WIDTH as i32 - LEGEND - LEFT), f64::from(HEIGHT as i32 - TOP - BOTTOM)];
            let scale = ((x[1] - x[0]) / inner[0]).max((y[1] - y[0]) / inner[1]).max(1e-6);
            for (range, pixels) in [(&mut x, inner[0]), (&mut y, inner[1])] {
                let middle = 0.5 * (range[0] + range[1]);
                *range = [middle - 0.5 * scale * pixels, middle + 0.5 * scale * pixels];
            }
        }
        let wide = |[low, high]: [f64; 2]| {
            let by = MARGIN * (high - low);
            Axis::linear(low - by, high + by)
        };
        let [x_label, y_label] = [x_label, y_label].map(str::to_string);
        LineFigure { title: title.into(), x_label, y_label, x: wide(x), y: wide(y), lines }
    }

    /// # Errors
    /// When plotters fails.
    pub fn svg(&self) -> Result<String> {
        sheet::svg(self)
    }

    fn style<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, line: usize) -> ShapeStyle {
        let before = self.lines[..line].iter().filter(|l| !l.is_truth).count();
        if self.lines[line].is_truth {
            sheet.stroke(&INK, 1)
        } else {
            sheet.stroke(&COLOURS[before % COLOURS.len()], 2)
        }
    }
}

impl Drawing for LineFigure {
    const WHAT: &'static str = "figure of lines";
    const SIZE: (u32, u32) = (WIDTH, HEIGHT);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        sheet.title(&self.title, WIDTH as i32)?;
        let area = sheet.root.margin(sheet.px(TOP), 0, 0, sheet.px(LEGEND));
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(BOTTOM))
            .y_label_area_size(sheet.px(LEFT))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        sheet.mesh(&mut chart, TEXT).x_desc(&self.x_label).y_desc(&self.y_label).draw()?;
        for (i, line) in self.lines.iter().enumerate() {
            let place = |p: &[f64; 2]| chart.backend_coord(&(p[0], p[1]));
            let places: Vec<(i32, i32)> = line.points.iter().map(place).collect();
            sheet.line(&places, self.style(sheet, i), &[])?;
        }
        for (i, line) in self.lines.iter().enumerate() {
            let y = sheet.px(TOP + 20 + 26 * i as i32);
            let x = sheet.px(WIDTH as i32 - LEGEND + 12);
            sheet.line(&[(x, y), (x + sheet.px(26), y)], self.style(sheet, i), &[])?;
            sheet.text(&line.name, (x + sheet.px(34), y), SMALL, HPos::Left)?;
        }
        Ok(())
    }
}
