//! Lays out a chart as shapes: axes, layers, legend. Lengths are px of the SVG.

use std::f64::consts::PI;

use plotters::prelude::{IntoFont, RGBAColor, RGBColor};
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, WHITE};

use super::{
    Chart, ColourScale, FOOT, LABEL_ROOM, LEFT, LEGEND, Layer, Mark, NARROW_SIZE, RIGHT, ROW,
    SCALE_ROWS, Sample, Stroke, TITLE_ROOM, X_TICKS, Y_TICKS,
};
use crate::report::axis::Axis;
use crate::report::colours::{FAINT, GRID, INK};

pub(super) type Point = [f64; 2];

/// Shapes that both backends can draw.
pub(super) enum Shape {
    Line(Vec<Point>, Stroke),
    Area(Vec<Point>, RGBAColor),
    /// Given by two opposite corners.
    Box([Point; 2], RGBAColor),
    /// With the mark's radius, fill and edge.
    Disc(Point, Mark),
    /// Text, the place of its left, middle or right end at half its height, anchor, size and colour.
    Text(String, Point, HPos, i32, RGBColor),
}

/// Font with which plotters measures text, and draws it in PNGs; SVGs only name the family.
pub(super) const FONT: &str = "sans-serif";
/// plotters writes SVG fonts at 1/1.24 of their size (its ratio of line height to em). These sizes are
/// chosen so that both backends look alike.
const TEXT: i32 = 17;
const SMALL: i32 = 15;
const TITLE: i32 = 21;
const TICK: f64 = 5.0;
const LEGEND_GAP: f64 = 22.0;
/// Length of a line's sample in the legend.
const SAMPLE: f64 = 34.0;
const SCALE_WIDTH: f64 = 24.0;
/// Half the width of an error bar's caps.
const CAP: f64 = 3.0;
/// Half the length of the stroke drawn for a line of one point.
const HALF_STROKE: f64 = 17.0;
/// Spacing of the hatching lines.
const HATCH: f64 = 12.0;
const HATCH_INK: RGBColor = RGBColor(205, 205, 205);

impl Chart {
    /// The shapes in drawing order, later ones on top.
    pub(super) fn shapes(&self) -> Vec<Shape> {
        let (mut sheet, width) = (self.sheet(), f64::from(self.size.0));
        let ([left, bottom], [right, top]) = (sheet.low, sheet.high);
        let size = fitting(&self.title, TITLE, width - 2.0 * LEFT);
        sheet.text(&self.title, [LEFT, 0.5 * TITLE_ROOM], HPos::Left, size);
        sheet.axes(width - 2.0 * LEFT);
        self.layers.iter().for_each(|layer| sheet.layer(layer));
        let mut corner = [right + LEGEND_GAP, top + 10.0];
        if self.is_narrow() {
            corner = [left, bottom + X_TICKS + 0.5 * ROW];
        }
        match &self.scale {
            Some(scale) if self.is_narrow() => {
                sheet.scale(scale, corner, (SCALE_ROWS - 2) as f64 * ROW);
                corner[0] = 0.5 * width;
            }
            Some(scale) => {
                let rows = self.legend.len() as f64 + 3.0;
                corner[1] = sheet.scale(scale, corner, bottom - top - rows * ROW) + ROW;
            }
            None => {}
        }
        sheet.legend(corner);
        sheet.shapes
    }

    /// Places and texts of the tips that are inside the axes.
    pub(super) fn tip_places(&self) -> Vec<(Point, &str)> {
        let sheet = self.sheet();
        let tips = self.tips.iter();
        tips.filter_map(|(at, text)| Some((sheet.inside(at)?, text.as_str()))).collect()
    }

    /// An empty sheet.
    fn sheet(&self) -> Sheet<'_> {
        let width = f64::from(self.size.0);
        let top = LABEL_ROOM + if self.title.is_empty() { 0.0 } else { TITLE_ROOM };
        let bare = self.legend.is_empty() && self.scale.is_none();
        let right = width - if bare || self.is_narrow() { RIGHT } else { LEGEND };
        let height = f64::from(if self.is_narrow() { NARROW_SIZE.1 } else { self.size.1 });
        let low = [LEFT + Y_TICKS, height - FOOT - X_TICKS];
        Sheet { chart: self, low, high: [right, top], shapes: Vec::new() }
    }
}

/// The corner of the axes' low ends, that of their high ends, and the shapes so far.
struct Sheet<'a> {
    chart: &'a Chart,
    low: Point,
    high: Point,
    shapes: Vec<Shape>,
}

impl Sheet<'_> {
    fn at(&self, x: f64, y: f64) -> Point {
        let share = [self.chart.x.share(x), self.chart.y.share(y)];
        [0, 1].map(|k| self.low[k] + share[k] * (self.high[k] - self.low[k]))
    }

    fn inside(&self, &[x, y]: &[f64; 2]) -> Option<Point> {
        (self.chart.x.contains(x) && self.chart.y.contains(y)).then(|| self.at(x, y))
    }

    fn clamped(&self, x: f64, y: f64) -> Point {
        self.at(x, y.clamp(self.chart.y.low, self.chart.y.high))
    }

    fn line(&mut self, points: &[Point], stroke: Stroke) {
        self.shapes.push(Shape::Line(points.to_vec(), stroke));
    }

    fn text(&mut self, text: &str, at: Point, anchor: HPos, size: i32) {
        self.shapes.push(Shape::Text(text.into(), at, anchor, size, INK));
    }

    fn axes(&mut self, room: f64) {
        let (chart, [left, bottom], [right, top]) = (self.chart, self.low, self.high);
        let size = if chart.title.is_empty() { SMALL } else { TEXT };
        let [grid, ink] = [GRID, INK].map(|colour| Stroke::new(colour, 1));
        for &value in &chart.x.ticks {
            let [u, _] = self.at(value, chart.y.low);
            if chart.grid {
                self.line(&[[u, top], [u, bottom]], grid);
            }
            self.line(&[[u, bottom], [u, bottom + TICK]], ink);
            self.text(&Axis::label(value), [u, bottom + X_TICKS / 3.0], HPos::Center, size);
        }
        for &value in &chart.y.ticks {
            let [_, v] = self.at(chart.x.low, value);
            if chart.grid {
                self.line(&[[left, v], [right, v]], grid);
            }
            self.line(&[[left - TICK, v], [left, v]], ink);
            self.text(&Axis::label(value), [left - 2.0 * TICK, v], HPos::Right, size);
        }
        self.line(&[[left, top], [left, bottom], [right, bottom]], ink);
        let [x_label, y_label] = &chart.labels;
        let below = [0.5 * (left + right), bottom + X_TICKS - TICK];
        self.text(x_label, below, HPos::Center, fitting(x_label, size, room));
        let above = [LEFT, top - 0.5 * LABEL_ROOM];
        self.text(y_label, above, HPos::Left, fitting(y_label, size, room));
    }

    fn layer(&mut self, layer: &Layer) {
        match layer {
            Layer::Line(points, stroke) => self.path(points, *stroke),
            Layer::Band(edges, colour) => {
                let there = edges.iter().map(|[x, low, _]| self.clamped(*x, *low));
                let back = edges.iter().rev().map(|[x, _, high]| self.clamped(*x, *high));
                let outline: Vec<Point> = there.chain(back).collect();
                if outline.len() > 2 {
                    self.shapes.push(Shape::Area(outline, *colour));
                }
            }
            Layer::ErrorBars(bars, stroke) => {
                bars.iter().for_each(|bar| self.error_bar(*bar, *stroke));
            }
            Layer::Marks(points, mark) => {
                let inside: Vec<Point> = points.iter().filter_map(|p| self.inside(p)).collect();
                inside.into_iter().for_each(|at| self.mark(at, *mark));
            }
            Layer::Tile(x, y, colour) => {
                let corners = [self.at(x[0], y[1]), self.at(x[1], y[0])];
                self.shapes.push(Shape::Box(corners, *colour));
            }
            Layer::Hatching => self.hatching(),
            Layer::Label([x, y], text) => {
                let ([u, v], half) = (self.at(*x, *y), 0.5 * width(text, SMALL) + 3.0);
                let corners = [[u - half, v - 8.0], [u + half, v + 8.0]];
                self.shapes.push(Shape::Box(corners, WHITE.mix(0.85)));
                self.text(text, [u, v], HPos::Center, SMALL);
            }
        }
    }

    fn path(&mut self, points: &[[f64; 2]], stroke: Stroke) {
        let places: Vec<Option<Point>> = points.iter().map(|p| self.inside(p)).collect();
        for part in places.split(Option::is_none) {
            let part: Vec<Point> = part.iter().flatten().copied().collect();
            match part[..] {
                [] => {}
                [[x, y]] => self.line(&[[x - HALF_STROKE, y], [x + HALF_STROKE, y]], stroke),
                _ => self.line(&part, stroke),
            }
        }
    }

    fn error_bar(&mut self, [x, low, high]: [f64; 3], stroke: Stroke) {
        let Axis { low: bottom, high: top, .. } = self.chart.y;
        if self.chart.x.contains(x) && low <= top && high >= bottom {
            let ends = [low, high].map(|y| self.clamped(x, y));
            self.line(&ends, stroke);
            for [u, v] in ends {
                self.line(&[[u - CAP, v], [u + CAP, v]], stroke);
            }
        }
    }

    fn hatching(&mut self) {
        let ([left, bottom], [right, top]) = (self.low, self.high);
        let height = bottom - top;
        for k in 0..((right - left + height) / HATCH).ceil() as usize {
            let start = left - height + HATCH * k as f64;
            let ends = [start.max(left), (start + height).min(right)];
            self.line(&ends.map(|u| [u, bottom - (u - start)]), Stroke::new(HATCH_INK, 1));
        }
    }

    fn mark(&mut self, at: Point, mark: Mark) {
        let Some(shape) = mark.shape.checked_sub(1) else {
            return self.shapes.push(Shape::Disc(at, mark));
        };
        let mut corners = corners(SHAPES[shape % SHAPES.len()], at, f64::from(mark.radius));
        self.shapes.push(Shape::Area(corners.clone(), mark.fill));
        corners.push(corners[0]);
        self.line(&corners, Stroke::new(mark.edge, 1));
    }

    fn legend(&mut self, [x, top]: Point) {
        for (i, entry) in self.chart.legend.iter().enumerate() {
            let y = top + ROW * i as f64;
            entry.samples.iter().for_each(|sample| self.sample(sample, [x, y]));
            let (indent, size, colour) = match entry.samples[..] {
                [] => (0.0, SMALL, FAINT),
                _ => (SAMPLE + 10.0, TEXT, INK),
            };
            let size = fitting(&entry.text, size, f64::from(self.chart.size.0) - x - indent);
            let text = entry.text.clone();
            self.shapes.push(Shape::Text(text, [x + indent, y], HPos::Left, size, colour));
        }
    }

    fn sample(&mut self, sample: &Sample, [x, y]: Point) {
        let end = x + SAMPLE;
        match sample {
            Sample::Line(stroke) => self.line(&[[x, y], [end, y]], *stroke),
            Sample::Band(colour) => {
                self.shapes.push(Shape::Box([[x, y - 7.0], [end, y + 7.0]], *colour));
            }
            Sample::Mark(mark) => self.mark([0.5 * (x + end), y], *mark),
            Sample::Hatching => (0..3).map(|i| x + HATCH * f64::from(i)).for_each(|left| {
                let ends = [[left, y + 0.5 * HATCH], [left + HATCH, y - 0.5 * HATCH]];
                self.line(&ends, Stroke::new(FAINT, 1));
            }),
        }
    }

    /// Draws a colour scale and returns its lower edge.
    fn scale(&mut self, scale: &ColourScale, [left, y]: Point, height: f64) -> f64 {
        let (right, top) = (left + SCALE_WIDTH, y + 16.0);
        let bottom = top + height;
        let at = |share: f64| bottom - share * height;
        self.text(&scale.title, [left, y], HPos::Left, TEXT);
        for (i, colour) in scale.colours.iter().enumerate() {
            let [low, high] = [i, i + 1].map(|i| at(i as f64 / scale.colours.len() as f64));
            self.shapes.push(Shape::Box([[left, high], [right, low]], (*colour).into()));
        }
        let ink = Stroke::new(INK, 1);
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        self.line(&corners, ink);
        for &tick in &scale.axis.ticks {
            let (y, end) = (at(scale.axis.share(tick)), right + TICK);
            self.line(&[[left, y], [end, y]], ink);
            self.text(&Axis::label(tick), [end + TICK, y], HPos::Left, TEXT);
        }
        bottom
    }
}

/// Width of a text; 0 if the font cannot measure it.
fn width(text: &str, size: i32) -> f64 {
    (FONT, size).into_font().box_size(text).map_or(0.0, |(width, _)| f64::from(width))
}

/// Largest font size, at most `size`, at which a text fits.
fn fitting(text: &str, size: i32, room: f64) -> i32 {
    let shrunk = f64::from(size) * room / width(text, size).max(1.0);
    size.min((shrunk as i32).max(SMALL / 2))
}

/// Marks after the disc: number of points, rotation in half angles between them, and whether it is a star.
/// Square, triangle, diamond, inverted triangle, star, rotated star.
const SHAPES: [(u8, f64, bool); 6] = [
    (4, 1.0, false),
    (3, 0.0, false),
    (4, 0.0, false),
    (3, 1.0, false),
    (4, 0.0, true),
    (4, 1.0, true),
];

fn corners((points, turn, star): (u8, f64, bool), [u, v]: Point, radius: f64) -> Vec<Point> {
    /// Scales corners beyond the radius of a disc of the same area.
    const REACH: f64 = 1.3;
    /// Ratio of a star's inner to its outer radius.
    const WAIST: f64 = 0.42;
    let half = PI / f64::from(points);
    let corner = |i: u8| {
        let length = if i.is_multiple_of(2) { 1.0 } else { WAIST } * REACH * radius;
        let (sin, cos) = (half * (f64::from(i) + turn)).sin_cos();
        [u + length * sin, v - length * cos]
    };
    (0..2 * points).step_by(if star { 1 } else { 2 }).map(corner).collect()
}
