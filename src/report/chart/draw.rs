//! How every chart looks: axes, layers, legend.

use std::io::Cursor;

use image::imageops::{FilterType, resize};
use image::{ImageFormat, RgbImage};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::layers::{HATCH, Plot, draw_mark};
use super::sheet::{Drawn, Pixel, SMALL, Sheet, TEXT, font_registered};
use super::{
    Chart, ColourScale, Entry, FOOT, LABEL_ROOM, LEFT, LEGEND, RIGHT, Sample, Stroke, TITLE_ROOM,
    X_TICKS, Y_TICKS,
};
use crate::error::{Error, Result};
use crate::report::axis::Axis;
use crate::report::colours::{FAINT, GRID, INK};

/// Pixels of the PNG a unit, after shrinking ...
const PNG_SCALE: u32 = 2;
/// ... by this factor, which smooths edges that plotters' bitmap leaves jagged.
const OVERSAMPLING: u32 = 2;
// All lengths are units.
const TITLE: i32 = 21;
const TICK: i32 = 5;
const LEGEND_GAP: i32 = 22;
/// From one row of the legend to the next.
const ROW: i32 = 25;
/// Length of a line's sample.
const SAMPLE: i32 = 34;
const SCALE_WIDTH: i32 = 24;

impl Chart {
    /// As SVG text.
    ///
    /// # Errors
    /// When plotters fails.
    pub fn svg(&self) -> Result<String> {
        let mut text = String::new();
        self.draw_on(SVGBackend::with_string(&mut text, self.size), 1)?;
        Ok(text)
    }

    /// As the bytes of a PNG.
    ///
    /// # Errors
    /// When plotters or the PNG encoder fails.
    pub fn png(&self) -> Result<Vec<u8>> {
        let scale = PNG_SCALE * OVERSAMPLING;
        let (width, height) = (self.size.0 * scale, self.size.1 * scale);
        let mut image = RgbImage::new(width, height);
        self.draw_on(BitMapBackend::with_buffer(&mut image, (width, height)), scale as i32)?;
        let (width, height) = (width / OVERSAMPLING, height / OVERSAMPLING);
        let small = resize(&image, width, height, FilterType::Triangle);
        let mut bytes = Vec::new();
        small.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).map_err(failed)?;
        Ok(bytes)
    }

    fn draw_on<B: DrawingBackend>(&self, backend: B, unit: i32) -> Result<()> {
        if !font_registered() {
            return Err(failed("the built-in font is damaged"));
        }
        let root = backend.into_drawing_area();
        let draw = || -> Drawn<B> {
            root.fill(&WHITE)?;
            self.draw(&Sheet { root: &root, unit })?;
            root.present()
        };
        draw().map_err(failed)
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        let (width, height) = (self.size.0 as i32, self.size.1 as i32);
        let title_room = if self.title.is_empty() { 0 } else { TITLE_ROOM };
        let bare = self.legend.is_empty() && self.scale.is_none();
        let (top, bottom) = (title_room + LABEL_ROOM, height - FOOT - X_TICKS);
        let right = width - if bare { RIGHT } else { LEGEND };
        let low = (sheet.px(LEFT + Y_TICKS), sheet.px(bottom));
        let plot =
            Plot { sheet, x: &self.x, y: &self.y, low, high: (sheet.px(right), sheet.px(top)) };
        let size = sheet.fitting(&self.title, TITLE, width - 2 * LEFT)?;
        let middle = sheet.px(TITLE_ROOM / 2);
        sheet.text(&self.title, (sheet.px(LEFT), middle), size, HPos::Left, &INK)?;
        self.draw_axes(&plot)?;
        self.layers.iter().try_for_each(|layer| plot.layer(layer))?;
        let mut corner = (sheet.px(right + LEGEND_GAP), sheet.px(top + 10));
        if let Some(scale) = &self.scale {
            let rows = self.legend.len() as i32 + 3;
            corner.1 = draw_scale(sheet, scale, corner, bottom - top - rows * ROW)? + sheet.px(ROW);
        }
        draw_legend(sheet, &self.legend, corner)
    }

    fn draw_axes<B: DrawingBackend>(&self, plot: &Plot<'_, B>) -> Drawn<B> {
        let (sheet, (left, bottom), (right, top)) = (plot.sheet, plot.low, plot.high);
        let size = if self.title.is_empty() { SMALL } else { TEXT };
        let (tick, room) = (sheet.px(TICK), self.size.0 as i32 - 2 * LEFT);
        let [grid, ink] = [GRID, INK].map(|colour| Stroke::new(colour, 1));
        for &value in &self.x.ticks {
            let (u, _) = plot.at(value, self.y.low);
            if self.grid {
                sheet.line(&[(u, top), (u, bottom)], grid)?;
            }
            sheet.line(&[(u, bottom), (u, bottom + tick)], ink)?;
            let below = (u, bottom + sheet.px(X_TICKS / 3));
            sheet.text(&Axis::label(value), below, size, HPos::Center, &INK)?;
        }
        for &value in &self.y.ticks {
            let (_, v) = plot.at(self.x.low, value);
            if self.grid {
                sheet.line(&[(left, v), (right, v)], grid)?;
            }
            sheet.line(&[(left - tick, v), (left, v)], ink)?;
            sheet.text(&Axis::label(value), (left - 2 * tick, v), size, HPos::Right, &INK)?;
        }
        sheet.line(&[(left, top), (left, bottom), (right, bottom)], ink)?;
        let [x_label, y_label] = &self.labels;
        let below = ((left + right) / 2, bottom + sheet.px(X_TICKS - TICK));
        sheet.text(x_label, below, sheet.fitting(x_label, size, room)?, HPos::Center, &INK)?;
        let above = (sheet.px(LEFT), top - sheet.px(LABEL_ROOM / 2));
        sheet.text(y_label, above, sheet.fitting(y_label, size, room)?, HPos::Left, &INK)
    }
}

fn failed(why: impl std::fmt::Display) -> Error {
    Error::Drawing { what: "a chart", why: why.to_string() }
}

fn draw_legend<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    legend: &[Entry],
    (x, top): Pixel,
) -> Drawn<B> {
    for (i, entry) in legend.iter().enumerate() {
        let y = top + sheet.px(ROW) * i as i32;
        entry.samples.iter().try_for_each(|sample| draw_sample(sheet, sample, (x, y)))?;
        let (indent, size, colour) =
            if entry.samples.is_empty() { (0, SMALL, FAINT) } else { (SAMPLE + 10, TEXT, INK) };
        let size = sheet.fitting(&entry.text, size, LEGEND - LEGEND_GAP - indent)?;
        sheet.text(&entry.text, (x + sheet.px(indent), y), size, HPos::Left, &colour)?;
    }
    Ok(())
}

fn draw_sample<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    sample: &Sample,
    (x, y): Pixel,
) -> Drawn<B> {
    let end = x + sheet.px(SAMPLE);
    match sample {
        Sample::Line(stroke) => sheet.line(&[(x, y), (end, y)], *stroke),
        Sample::Band(colour) => sheet.fill([(x, y - sheet.px(7)), (end, y + sheet.px(7))], colour),
        Sample::Mark(mark) => draw_mark(sheet, ((x + end) / 2, y), *mark),
        Sample::Hatching => (0..3).try_for_each(|i| {
            let (left, half) = (x + sheet.px(HATCH * i), sheet.px(HATCH / 2));
            sheet.line(&[(left, y + half), (left + 2 * half, y - half)], Stroke::new(FAINT, 1))
        }),
    }
}

/// The place below it.
fn draw_scale<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    scale: &ColourScale,
    (left, y): Pixel,
    height: i32,
) -> Drawn<B, i32> {
    let (right, top) = (left + sheet.px(SCALE_WIDTH), y + sheet.px(16));
    let bottom = top + sheet.px(height);
    let at = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
    sheet.text(&scale.title, (left, y), TEXT, HPos::Left, &INK)?;
    for (i, colour) in scale.colours.iter().enumerate() {
        let [low, high] = [i, i + 1].map(|i| at(i as f64 / scale.colours.len() as f64));
        sheet.fill([(left, high), (right, low)], colour)?;
    }
    sheet.frame([(left, top), (right, bottom)], &INK)?;
    for &tick in &scale.axis.ticks {
        let y = at(scale.axis.share(tick));
        let end = right + sheet.px(TICK);
        sheet.line(&[(left, y), (end, y)], Stroke::new(INK, 1))?;
        sheet.text(&Axis::label(tick), (end + sheet.px(TICK), y), TEXT, HPos::Left, &INK)?;
    }
    Ok(bottom)
}
