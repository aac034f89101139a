//! A chart as data: axes, layers, legend. SVG and PNG are drawn from it by one set of functions.

mod draw;
mod shapes;

use plotters::style::{RGBAColor, RGBColor};

use super::axis::Axis;

/// Everything that a chart shows. Values outside the axes are not drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Empty where the page around it says it.
    pub title: String,
    /// Width and height, px of the SVG.
    pub size: (u32, u32),
    pub x: Axis,
    pub y: Axis,
    /// What `x` and `y` are, with their units.
    pub labels: [String; 2],
    pub grid: bool,
    /// Drawn in this order.
    pub layers: Vec<Layer>,
    /// What a colour means, where it stands for a number: above the legend.
    pub scale: Option<ColourScale>,
    /// To the right of the axes; below them where the chart is narrow.
    pub legend: Vec<Entry>,
    /// What a reader who points at a place of the SVG is told.
    pub tips: Vec<([f64; 2], String)>,
}

/// Things of one kind, in the units of the axes.
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// Straight from point to point; a lone point becomes a short stroke.
    Line(Vec<[f64; 2]>, Stroke),
    /// x, lower and upper end: the area between; ends are clamped to the axis.
    Band(Vec<[f64; 3]>, RGBAColor),
    /// x, lower and upper end; ends are clamped to the axis.
    ErrorBars(Vec<[f64; 3]>, Stroke),
    Marks(Vec<[f64; 2]>, Mark),
    /// From and to in x, from and to in y: a tile of a heat map, or a histogram's bar.
    Tile([f64; 2], [f64; 2], RGBAColor),
    /// Over all that the axes span: what later layers do not cover was not measured.
    Hatching,
    /// On a white ground.
    Label([f64; 2], String),
}

/// How a line looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    pub colour: RGBAColor,
    pub width: u32,
    /// Lengths of stroke and gap; none for a whole line.
    pub dashes: Option<[i32; 2]>,
}

/// How a point looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mark {
    /// Told apart without colour: 0 is a disc, 1 to 6 have corners, then they repeat.
    pub shape: usize,
    pub radius: i32,
    pub fill: RGBAColor,
    pub edge: RGBAColor,
}

/// What a sample in the legend looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sample {
    Line(Stroke),
    Band(RGBAColor),
    Mark(Mark),
    Hatching,
}

/// A row of the legend: samples over one another, then words. Without samples it is a remark.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    pub samples: Vec<Sample>,
    pub text: String,
}

/// Equal steps of colour from the low end of an axis to its high one.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourScale {
    pub title: String,
    pub axis: Axis,
    pub colours: Vec<RGBColor>,
}

/// Of most charts: as wide as a page.
const SIZE: (u32, u32) = (960, 540);
/// Of one of two beside each other.
const SMALL_SIZE: (u32, u32) = (470, 300);

/// Of one on a telephone, without its legend.
const NARROW_SIZE: (u32, u32) = (400, 320);
/// From one row of the legend to the next.
const ROW: f64 = 25.0;
/// Height of a colour scale below the axes, rows of the legend.
const SCALE_ROWS: usize = 6;

// Room around the axes, px of the SVG.
const LEFT: f64 = 12.0;
const RIGHT: f64 = 20.0;
const FOOT: f64 = 8.0;
const TITLE_ROOM: f64 = 40.0;
/// Above the axes, for the label of y.
const LABEL_ROOM: f64 = 30.0;
const X_TICKS: f64 = 48.0;
const Y_TICKS: f64 = 54.0;
/// Column to the right.
const LEGEND: f64 = 225.0;

impl Chart {
    /// As wide as a page, with a grid; layers and legend are still to be added.
    pub fn new(title: &str, [x, y]: [Axis; 2], labels: [&str; 2]) -> Self {
        let (title, labels) = (title.into(), labels.map(str::to_string));
        let (layers, scale, legend, tips) = (Vec::new(), None, Vec::new(), Vec::new());
        Chart { title, size: SIZE, x, y, labels, grid: true, layers, scale, legend, tips }
    }

    /// Half as wide, without a title.
    pub fn small([x, y]: [Axis; 2], labels: [&str; 2]) -> Self {
        let axes = [x.sparse(), y.sparse()];
        Chart { size: SMALL_SIZE, ..Chart::new("", axes, labels) }
    }

    /// The same for a telephone, or for half a page: fewer ticks, the legend below. `None` where the
    /// chart is narrow already.
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

    /// Has it its legend below the axes?
    fn is_narrow(&self) -> bool {
        self.size.0 == NARROW_SIZE.0
    }

    /// Widens one of two ranges so that a unit is as long in x as in y on a chart as wide as a
    /// page with a legend.
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
    /// A disc without an edge of another colour.
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
