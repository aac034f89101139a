//! A sheet to draw on, the same for both backends.
//!
//! Sizes are in units of the SVG's pixel; a PNG is drawn at a multiple of them. What draws fails
//! when the backend does.

use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::Stroke;

pub(super) type Drawn<B, T = ()> =
    Result<T, DrawingAreaErrorKind<<B as DrawingBackend>::ErrorType>>;
/// A place on the backend.
pub(super) type Pixel = (i32, i32);

/// plotters' bitmap centres the box of a line, not the letters, units.
const PNG_TEXT_DROP: i32 = 2;
/// plotters writes SVG fonts at 1/1.24 of their size (its ratio of line to em); sizes here are
/// such that both backends agree to the eye.
pub(super) const TEXT: i32 = 17;
pub(super) const SMALL: i32 = 15;
const FONT: &str = "sans-serif";

/// plotters measures (and, in PNGs, draws) text with this font; SVGs only name the family.
pub(super) fn font_registered() -> bool {
    static DONE: OnceLock<bool> = OnceLock::new();
    *DONE.get_or_init(|| {
        let bytes = include_bytes!("../fonts/kinoise-sans.ttf");
        register_font(FONT, FontStyle::Normal, bytes).is_ok()
    })
}

/// The whole drawing area and the size of a unit, px.
pub(super) struct Sheet<'a, B: DrawingBackend> {
    pub root: &'a DrawingArea<B, Shift>,
    pub unit: i32,
}

impl<B: DrawingBackend> Sheet<'_, B> {
    /// Units to px.
    pub fn px(&self, units: i32) -> i32 {
        units * self.unit
    }

    pub fn style<C: Color>(&self, colour: &C, width: u32) -> ShapeStyle {
        colour.stroke_width(width * self.unit.unsigned_abs())
    }

    pub fn line(&self, points: &[Pixel], stroke: Stroke) -> Drawn<B> {
        let (points, style) = (points.to_vec(), self.style(&stroke.colour, stroke.width));
        match stroke.dashes.map(|units| units.map(|u| self.px(u))) {
            Some([dash, gap]) => self.root.draw(&DashedPathElement::new(points, dash, gap, style)),
            None => self.root.draw(&PathElement::new(points, style)),
        }
    }

    pub fn fill<C: Color>(&self, corners: [Pixel; 2], colour: &C) -> Drawn<B> {
        self.root.draw(&Rectangle::new(corners, colour.filled()))
    }

    pub fn frame<C: Color>(&self, corners: [Pixel; 2], colour: &C) -> Drawn<B> {
        self.root.draw(&Rectangle::new(corners, self.style(colour, 1)))
    }

    /// Text whose left (or as `anchor` says) middle is at `at`.
    pub fn text<C: Color>(
        &self,
        text: &str,
        (x, y): Pixel,
        size: i32,
        anchor: HPos,
        colour: &C,
    ) -> Drawn<B> {
        let drop = if self.unit > 1 { self.px(PNG_TEXT_DROP) } else { 0 };
        let style = self.font(size).color(colour).pos(Pos::new(anchor, VPos::Center));
        self.root.draw_text(text, &style, (x, y + drop))
    }

    fn font(&self, size: i32) -> TextStyle<'static> {
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
}
