//! A chart as data: axes, layers, legend. SVG and PNG are drawn from it by one set of functions.

mod draw;
mod shapes;

use plotters::style::{RGBAColor, RGBColor};

use super::axis::Axis;

/// Everything a chart shows. Values outside the axes are not drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Empty where the surrounding page gives the title.
    pub title: String,
    /// Width and height, px of the SVG.
    pub size: (u32, u32),
    pub x: Axis,
    pub y: Axis,
    /// Labels of `x` and `y`, with their units.
    pub labels: [String; 2],
    pub grid: bool,
    /// Drawn in this order.
    pub layers: Vec<Layer>,
    /// Colour scale, drawn above the legend, for colours that stand for a number.
    pub scale: Option<ColourScale>,
    /// To the right of the axes; below them where the chart is narrow.
    pub legend: Vec<Entry>,
    /// Places in the SVG and the text shown when a reader points at them.
    pub tips: Vec<([f64; 2], String)>,
}

/// Elements of one kind, in the units of the axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// Straight segments from point to point; a single point becomes a short stroke.
    Line(Vec<[f64; 2]>, Stroke),
    /// Area between the lower and the upper end at each x; ends are clamped to the axis.
    Band(Vec<[f64; 3]>, RGBAColor),
    /// x, lower end and upper end; ends are clamped to the axis.
    ErrorBars(Vec<[f64; 3]>, Stroke),
    Marks(Vec<[f64; 2]>, Mark),
    /// Range in x and range in y: a tile of a heat map or a bar of a histogram.
    Tile([f64; 2], [f64; 2], RGBAColor),
    /// Hatches the whole plot area; what later layers leave uncovered was not measured.
    Hatching,
    /// Text on a white background.
    Label([f64; 2], String),
}

/// Style of a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    pub colour: RGBAColor,
    pub width: u32,
    /// Lengths of dash and gap; `None` for a solid line.
    pub dashes: Option<[i32; 2]>,
}

/// Style of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Shape, distinguishable without colour: 0 is a disc, 1 to 6 have corners, then these repeat.
    pub shape: usize,
    pub radius: i32,
    pub fill: RGBAColor,
    pub edge: RGBAColor,
}

/// A sample in the legend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sample {
    Line(Stroke),
    Band(RGBAColor),
    Mark(Mark),
    Hatching,
}

/// A row of the legend: superimposed samples, then text. Without samples it is a remark.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    pub samples: Vec<Sample>,
    pub text: String,
}

/// Equal steps of colour from the low to the high end of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourScale {
    pub title: String,
    pub axis: Axis,
    pub colours: Vec<RGBColor>,
}

/// Size of most charts: as wide as a page.
const SIZE: (u32, u32) = (960, 540);
/// Size of one of two charts side by side.
const SMALL_SIZE: (u32, u32) = (470, 300);

/// Size of a chart on a phone, without its legend.
const NARROW_SIZE: (u32, u32) = (400, 320);
/// Spacing of legend rows.
const ROW: f64 = 25.0;
/// Height of a colour scale below the axes, rows of the legend.
const SCALE_ROWS: usize = 6;

// Room around the axes, px of the SVG.
const LEFT: f64 = 12.0;
const RIGHT: f64 = 20.0;
const FOOT: f64 = 8.0;
const TITLE_ROOM: f64 = 40.0;
/// Room above the axes for the label of y.
const LABEL_ROOM: f64 = 30.0;
const X_TICKS: f64 = 48.0;
const Y_TICKS: f64 = 54.0;
/// Width of the column to the right.
const LEGEND: f64 = 225.0;

impl Chart {
    /// A chart as wide as a page, with a grid; layers and legend are added later.
    pub fn new(title: &str, [x, y]: [Axis; 2], labels: [&str; 2]) -> Self {
        let (title, labels) = (title.into(), labels.map(str::to_string));
        let (layers, scale, legend, tips) = (Vec::new(), None, Vec::new(), Vec::new());
        Chart { title, size: SIZE, x, y, labels, grid: true, layers, scale, legend, tips }
    }

    /// A chart half as wide, without a title.
    pub fn small([x, y]: [Axis; 2], labels: [&str; 2]) -> Self {
        let axes = [x.sparse(), y.sparse()];
        Chart { size: SMALL_SIZE, ..Chart::new("", axes, labels) }
    }

    /// The same chart for a phone or for half a page, with fewer ticks and the legend below. `None` if the
    /// chart is already narrow.
    pub fn narrow(&self) -> Option<Self> {
        if self.size.0 <= SMALL_SIZE.0 {
            return None;
        }
        let sparse = |axis: &Axis| if axis.log { axis.clone() } else { axis.clone().sparse() };
        let rows = self.legend.len().max(if self.scale.is_some() { SCALE_ROWS } else { 0 });
        let below = if rows > 0 { rows as u32 * ROW as u32 + X_TICKS as u32 / 2 } else { 0 };
        let size = (NARROW_SIZE.0, NARROW_SIZE.1 + below);
        Some(Chart { size, x: sparse(&self.x), y: sparse(&self.y), ..self.clone() })
    }

    /// Whether the legend is below the axes.
    fn is_narrow(&self) -> bool {
        self.size.0 == NARROW_SIZE.0
    }

    /// Widens one of two ranges so that a unit is as long in x as in y, on a page-wide chart with a legend.
    pub fn equal_units(ranges: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
        let across = f64::from(SIZE.0) - LEFT - Y_TICKS - LEGEND;
        let down = f64::from(SIZE.1) - TITLE_ROOM - LABEL_ROOM - X_TICKS - FOOT;
        let inner = [across, down];
        let unit = |k: usize| (ranges[k][1] - ranges[k][0]) / inner[k];
        let unit = unit(0).max(unit(1)).max(f64::MIN_POSITIVE);
        [0, 1].map(|k| {
            let middle = 0.5 * (ranges[k][0] + ranges[k][1]);
            [-0.5, 0.5].map(|side| middle + side * unit * inner[k])
        })
    }
}

impl Stroke {
    pub fn new(colour: impl Into<RGBAColor>, width: u32) -> Self {
        Stroke { colour: colour.into(), width, dashes: None }
    }

    pub fn dashed(self, stroke_and_gap: [i32; 2]) -> Self {
        Stroke { dashes: Some(stroke_and_gap), ..self }
    }
}

impl Mark {
    /// A disc whose edge has the fill colour.
    pub fn dot(colour: impl Into<RGBAColor>, radius: i32) -> Self {
        let colour = colour.into();
        Mark { shape: 0, radius, fill: colour, edge: colour }
    }
}

impl Entry {
    pub fn new(samples: impl Into<Vec<Sample>>, text: impl Into<String>) -> Self {
        Entry { samples: samples.into(), text: text.into() }
    }
}
