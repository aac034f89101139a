//! A sheet to draw on: one generic drawing, two backends.
//!
//! Sizes are in units of the SVG's pixel; the PNG is drawn at a multiple of them and shrunk,
//! which smooths edges that plotters' bitmap leaves jagged.

use std::io::Cursor;
use std::sync::OnceLock;

use image::imageops::{FilterType, resize};
use image::{ImageFormat, RgbImage};
use plotters::chart::MeshStyle;
use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::colours::{GRID, INK};
use crate::error::{Error, Result};

pub type Drawn<B, T = ()> = Result<T, DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;
/// A place on the backend.
pub type Pixel = (i32, i32);

/// Something that can be drawn.
pub trait Drawing {
    /// For the error message.
    const WHAT: &'static str;
    /// Width and height of most drawings of the kind, units.
    const SIZE: (u32, u32);

    /// Width and height of this one, units.
    fn size(&self) -> (u32, u32) {
        Self::SIZE
    }

    /// # Errors
    /// When the backend fails.
    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B>;
}

/// Pixels of the PNG a unit, after shrinking ...
const PNG_SCALE: u32 = 2;
/// ... by this factor.
const OVERSAMPLING: u32 = 2;
/// plotters' bitmap centres the box of a line, not the letters, units.
const PNG_TEXT_DROP: i32 = 2;
/// plotters writes SVG fonts at 1/1.24 of their size (its ratio of line to em); sizes here are
/// such that both backends agree to the eye.
pub const TEXT: i32 = 17;
pub const SMALL: i32 = 15;
const TITLE: i32 = 21;
const FONT: &str = "sans-serif";

/// The drawing as SVG text.
///
/// # Errors
/// When plotters fails.
pub fn svg(drawing: &impl Drawing) -> Result<String> {
    let mut text = String::new();
    on_sheet(drawing, SVGBackend::with_string(&mut text, drawing.size()), 1)?;
    Ok(text)
}

/// The drawing as the bytes of a PNG.
///
/// # Errors
/// When plotters or the PNG encoder fails.
pub fn png(drawing: &impl Drawing) -> Result<Vec<u8>> {
    let scale = PNG_SCALE * OVERSAMPLING;
    let (width, height) = drawing.size();
    let (width, height) = (width * scale, height * scale);
    let mut image = RgbImage::new(width, height);
    on_sheet(drawing, BitMapBackend::with_buffer(&mut image, (width, height)), scale as i32)?;
    let small = resize(&image, width / OVERSAMPLING, height / OVERSAMPLING, FilterType::Triangle);
    let mut bytes = Vec::new();
    small.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).map_err(failed(drawing))?;
    Ok(bytes)
}

fn failed<D: Drawing, E: std::fmt::Display>(_: &D) -> impl Fn(E) -> Error {
    |e| Error::Drawing { what: D::WHAT, why: e.to_string() }
}

fn on_sheet<B: DrawingBackend>(drawing: &impl Drawing, backend: B, unit: i32) -> Result<()> {
    if !font_registered() {
        return Err(failed(drawing)("the built-in font is damaged"));
    }
    let root = backend.into_drawing_area();
    let draw = || -> Drawn<B> {
        root.fill(&WHITE)?;
        let text_drop = if unit > 1 { unit * PNG_TEXT_DROP } else { 0 };
        drawing.draw(&Sheet { root: &root, unit, text_drop })?;
        root.present()
    };
    draw().map_err(failed(drawing))
}

/// plotters measures (and, in PNGs, draws) text with this font; SVGs only name the family.
fn font_registered() -> bool {
    static DONE: OnceLock<bool> = OnceLock::new();
    *DONE.get_or_init(|| {
        let bytes = include_bytes!("fonts/kinoise-sans.ttf");
        register_font(FONT, FontStyle::Normal, bytes).is_ok()
    })
}

/// The whole drawing area and the size of a unit, px. What draws fails when the backend does.
pub struct Sheet<'a, B: DrawingBackend> {
    pub root: &'a DrawingArea<B, Shift>,
    pub unit: i32,
    /// What the backend sets text too high, px.
    text_drop: i32,
}

/// What the plotters chart inside a sheet is like.
pub type Chart<'a, B, X, Y> = ChartContext<'a, B, Cartesian2d<X, Y>>;

/// Stroke and gap of a broken line, units; empty for a whole one.
pub type Dashes = &'static [i32];

impl<B: DrawingBackend> Sheet<'_, B> {
    /// Units to px.
    pub fn px(&self, units: i32) -> i32 {
        units * self.unit
    }

    /// A line style, its width in units.
    pub fn stroke<C: Color>(&self, colour: &C, width: u32) -> ShapeStyle {
        colour.stroke_width(width * self.unit.unsigned_abs())
    }

    pub fn line(&self, points: &[Pixel], style: ShapeStyle, dashes: Dashes) -> Drawn<B> {
        match *dashes {
            [stroke, gap] => self.root.draw(&DashedPathElement::new(
                points.to_vec(),
                self.px(stroke),
                self.px(gap),
                style,
            )),
            _ => self.root.draw(&PathElement::new(points.to_vec(), style)),
        }
    }

    /// Axes and a grid in the style of all figures, with text of this size; labels and ticks are
    /// still to be set, and it is to be drawn.
    pub fn mesh<'a, 'b>(
        &self,
        chart: &'b mut Chart<'a, B, Axis, Axis>,
        size: i32,
    ) -> MeshStyle<'a, 'b, Axis, Axis, B> {
        let mut mesh = chart.configure_mesh();
        mesh.light_line_style(TRANSPARENT)
            .bold_line_style(self.stroke(&GRID, 1))
            .axis_style(self.stroke(&INK, 1))
            .label_style(self.font(size).color(&INK))
            .axis_desc_style(self.font(size).color(&INK));
        mesh
    }

    pub fn fill<C: Color>(&self, corners: [Pixel; 2], colour: &C) -> Drawn<B> {
        self.root.draw(&Rectangle::new(corners, colour.filled()))
    }

    /// Text whose left (or as `anchor` says) middle is at `at`.
    pub fn text(&self, text: &str, at: Pixel, size: i32, anchor: HPos) -> Drawn<B> {
        self.coloured_text(text, at, size, anchor, &INK)
    }

    pub fn coloured_text<C: Color>(
        &self,
        text: &str,
        at: Pixel,
        size: i32,
        anchor: HPos,
        colour: &C,
    ) -> Drawn<B> {
        let style = self.font(size).color(colour).pos(Pos::new(anchor, VPos::Center));
        self.root.draw_text(text, &style, (at.0, at.1 + self.text_drop))
    }

    pub fn font(&self, size: i32) -> TextStyle<'static> {
        (FONT, self.px(size)).into_text_style(self.root)
    }

    /// Width of a text, px.
    pub fn width(&self, text: &str, size: i32) -> Drawn<B, i32> {
        Ok(self.root.estimate_text_size(text, &self.font(size))?.0 as i32)
    }

    /// The size, at most `size`, at which a text fits into so many units.
    pub fn fitting(&self, text: &str, size: i32, room: i32) -> Drawn<B, i32> {
        let (needed, room) = (self.width(text, size)?.max(1), self.px(room));
        Ok(if needed > room { (size * room / needed).max(SMALL / 2) } else { size })
    }

    /// The figure's title, as large as fits.
    pub fn title(&self, text: &str, width: i32) -> Drawn<B> {
        const LEFT: i32 = 16;
        const MIDDLE: i32 = 22;
        let size = self.fitting(text, TITLE, width - 2 * LEFT)?;
        self.text(text, (self.px(LEFT), self.px(MIDDLE)), size, HPos::Left)
    }
}
