//! How every chart looks.

use std::f64::consts::PI;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::{
    Chart, ColourScale, Entry, FOOT, LABEL_ROOM, LEFT, LEGEND, Layer, Mark, RIGHT, SIZE, Sample,
    Stroke, TITLE_ROOM, X_TICKS, Y_TICKS,
};
use crate::report::axis::Axis;
use crate::report::colours::{FAINT, INK};
use crate::report::sheet::{Drawing, Drawn, Pixel, SMALL, Sheet, TEXT};

// All lengths are units.
const LEGEND_GAP: i32 = 22;
/// From one row of the legend to the next.
const ROW: i32 = 25;
/// Length of a line's sample.
const SAMPLE: i32 = 34;
const BAR_WIDTH: i32 = 24;
/// Half the width of an error bar's ends.
const CAP: i32 = 3;
/// From one line of the hatching to the next.
const HATCH: i32 = 12;
const HATCH_INK: RGBColor = RGBColor(205, 205, 205);

impl Drawing for Chart {
    const WHAT: &'static str = "chart";
    const SIZE: (u32, u32) = SIZE;

    fn size(&self) -> (u32, u32) {
        self.size
    }

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        let width = self.size.0 as i32;
        let (top, size) = if self.title.is_empty() { (0, SMALL) } else { (TITLE_ROOM, TEXT) };
        let top = top + LABEL_ROOM;
        let bare = self.legend.is_empty() && self.scale.is_none();
        let right = if bare { RIGHT } else { LEGEND };
        sheet.title(&self.title, width)?;
        let [x_size, y_size] =
            [0, 1].map(|k| sheet.fitting(&self.labels[k], size, width - 2 * LEFT));
        let y_label = (sheet.px(LEFT), sheet.px(top - LABEL_ROOM / 2));
        sheet.text(&self.labels[1], y_label, y_size?, HPos::Left)?;
        let [margin_top, bottom, margin_left, margin_right] =
            [top, FOOT, LEFT, right].map(|units| sheet.px(units));
        let area = sheet.root.margin(margin_top, bottom, margin_left, margin_right);
        let mut axes = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(X_TICKS))
            .y_label_area_size(sheet.px(Y_TICKS))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        let mut mesh = sheet.mesh(&mut axes, size);
        mesh.axis_desc_style(sheet.font(x_size?).color(&INK)).x_desc(self.labels[0].as_str());
        if !self.grid {
            mesh.disable_mesh();
        }
        mesh.set_all_tick_mark_size(sheet.px(5)).draw()?;
        let at = |x, y| axes.backend_coord(&(x, y));
        let plot = Plot { sheet, x: &self.x, y: &self.y, at: &at };
        self.layers.iter().try_for_each(|layer| plot.layer(layer))?;
        let mut corner = (sheet.px(width - LEGEND + LEGEND_GAP), sheet.px(top + 10));
        if let Some(scale) = &self.scale {
            let rows = self.legend.len() as i32 * ROW;
            let height = self.size.1 as i32 - top - X_TICKS - FOOT - rows - 3 * ROW;
            corner.1 = draw_scale(sheet, scale, corner, height)? + sheet.px(ROW);
        }
        draw_legend(sheet, &self.legend, corner)
    }
}

/// A sheet with axes: from values to places.
struct Plot<'a, B: DrawingBackend> {
    sheet: &'a Sheet<'a, B>,
    x: &'a Axis,
    y: &'a Axis,
    at: &'a dyn Fn(f64, f64) -> Pixel,
}

impl<B: DrawingBackend> Plot<'_, B> {
    fn layer(&self, layer: &Layer) -> Drawn<B> {
        match layer {
            Layer::Line(points, stroke) => self.line(points, *stroke),
            Layer::Band(edges, colour) => self.band(edges, *colour),
            Layer::ErrorBars(bars, stroke) => {
                bars.iter().try_for_each(|bar| self.error_bar(*bar, *stroke))
            }
            Layer::Marks(points, mark) => {
                let inside = points.iter().filter_map(|p| self.inside(p));
                inside.into_iter().try_for_each(|at| draw_mark(self.sheet, at, *mark))
            }
            Layer::Tile(x, y, colour) => {
                self.sheet.fill([(self.at)(x[0], y[1]), (self.at)(x[1], y[0])], colour)
            }
            Layer::Hatching => self.hatching(),
            Layer::Label([x, y], text) => self.label((self.at)(*x, *y), text),
        }
    }

    fn inside(&self, [x, y]: &[f64; 2]) -> Option<Pixel> {
        (self.x.contains(*x) && self.y.contains(*y)).then(|| (self.at)(*x, *y))
    }

    fn clamped(&self, x: f64, y: f64) -> Pixel {
        (self.at)(x, y.clamp(self.y.low, self.y.high))
    }

    fn line(&self, points: &[[f64; 2]], stroke: Stroke) -> Drawn<B> {
        let places: Vec<Option<Pixel>> = points.iter().map(|p| self.inside(p)).collect();
        for part in places.split(Option::is_none) {
            let part: Vec<Pixel> = part.iter().flatten().copied().collect();
            match part[..] {
                [] => {}
                [(x, y)] => {
                    let half = self.sheet.px(SAMPLE / 2);
                    draw_line(self.sheet, &[(x - half, y), (x + half, y)], stroke)?;
                }
                _ => draw_line(self.sheet, &part, stroke)?,
            }
        }
        Ok(())
    }

    fn band(&self, edges: &[[f64; 3]], colour: RGBAColor) -> Drawn<B> {
        let there = edges.iter().map(|[x, low, _]| self.clamped(*x, *low));
        let back = edges.iter().rev().map(|[x, _, high]| self.clamped(*x, *high));
        let outline: Vec<Pixel> = there.chain(back).collect();
        if outline.len() > 2 {
            self.sheet.root.draw(&Polygon::new(outline, colour))
        } else {
            Ok(())
        }
    }

    fn error_bar(&self, [x, low, high]: [f64; 3], stroke: Stroke) -> Drawn<B> {
        if !(self.x.contains(x) && low <= self.y.high && high >= self.y.low) {
            return Ok(());
        }
        let ends = [low, high].map(|y| self.clamped(x, y));
        draw_line(self.sheet, &ends, stroke)?;
        let cap = self.sheet.px(CAP);
        ends.iter()
            .try_for_each(|&(u, v)| draw_line(self.sheet, &[(u - cap, v), (u + cap, v)], stroke))
    }

    fn hatching(&self) -> Drawn<B> {
        let (left, bottom) = (self.at)(self.x.low, self.y.low);
        let (right, top) = (self.at)(self.x.high, self.y.high);
        let style = self.sheet.stroke(&HATCH_INK, 1);
        let height = bottom - top;
        for start in (left - height..right).step_by(self.sheet.px(HATCH).unsigned_abs() as usize) {
            let ends = [start.max(left), (start + height).min(right)];
            self.sheet.line(&ends.map(|u| (u, bottom - (u - start))), style, &[])?;
        }
        Ok(())
    }

    fn label(&self, (u, v): Pixel, text: &str) -> Drawn<B> {
        let sheet = self.sheet;
        let half = [sheet.width(text, SMALL)? / 2 + sheet.px(3), sheet.px(8)];
        let corners = [(u - half[0], v - half[1]), (u + half[0], v + half[1])];
        sheet.fill(corners, &WHITE.mix(0.85))?;
        sheet.text(text, (u, v), SMALL, HPos::Center)
    }
}

fn draw_line<B: DrawingBackend>(sheet: &Sheet<'_, B>, points: &[Pixel], s: Stroke) -> Drawn<B> {
    sheet.line(points, sheet.stroke(&s.colour, s.width), s.dashes)
}

fn draw_mark<B: DrawingBackend>(sheet: &Sheet<'_, B>, at: Pixel, mark: Mark) -> Drawn<B> {
    let (radius, edge) = (sheet.px(mark.radius), sheet.stroke(&mark.edge, 1));
    let Some(shape) = mark.shape.checked_sub(1) else {
        sheet.root.draw(&Circle::new(at, radius, mark.fill.filled()))?;
        return sheet.root.draw(&Circle::new(at, radius, edge));
    };
    let mut corners = corners(SHAPES[shape % SHAPES.len()], at, f64::from(radius));
    sheet.root.draw(&Polygon::new(corners.clone(), mark.fill.filled()))?;
    corners.push(corners[0]);
    sheet.line(&corners, edge, &[])
}

/// Marks after the disc: number of points, turn in half angles between them, and whether it is a
/// star. Square, triangle, diamond, triangle upside down, star, star on its side.
const SHAPES: [(u8, f64, bool); 6] = [
    (4, 1.0, false),
    (3, 0.0, false),
    (4, 0.0, false),
    (3, 1.0, false),
    (4, 0.0, true),
    (4, 1.0, true),
];

fn corners((points, turn, star): (u8, f64, bool), (u, v): Pixel, radius: f64) -> Vec<Pixel> {
    /// Corners reach farther than a disc of the same area.
    const REACH: f64 = 1.3;
    /// Of a star, from its middle to its inner corners over that to its points.
    const WAIST: f64 = 0.42;
    let half = PI / f64::from(points);
    let corner = |i: u8| {
        let length = if i.is_multiple_of(2) { 1.0 } else { WAIST } * REACH * radius;
        let (sin, cos) = (half * (f64::from(i) + turn)).sin_cos();
        (u + (length * sin).round() as i32, v - (length * cos).round() as i32)
    };
    (0..2 * points).step_by(if star { 1 } else { 2 }).map(corner).collect()
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
        sheet.coloured_text(&entry.text, (x + sheet.px(indent), y), size, HPos::Left, &colour)?;
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
        Sample::Line(stroke) => draw_line(sheet, &[(x, y), (end, y)], *stroke),
        Sample::Band(colour) => sheet.fill([(x, y - sheet.px(7)), (end, y + sheet.px(7))], colour),
        Sample::Mark(mark) => draw_mark(sheet, ((x + end) / 2, y), *mark),
        Sample::Hatching => (0..3).try_for_each(|i| {
            let (left, step) = (x + sheet.px(HATCH * i), sheet.px(HATCH / 2));
            let stroke = Stroke::new(FAINT, 1);
            draw_line(sheet, &[(left, y + step), (left + 2 * step, y - step)], stroke)
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
    let (right, top) = (left + sheet.px(BAR_WIDTH), y + sheet.px(16));
    let bottom = top + sheet.px(height);
    let at = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
    sheet.text(&scale.title, (left, y), TEXT, HPos::Left)?;
    for (i, colour) in scale.colours.iter().enumerate() {
        let [low, high] = [i, i + 1].map(|i| at(i as f64 / scale.colours.len() as f64));
        sheet.fill([(left, high), (right, low)], colour)?;
    }
    let ink = sheet.stroke(&INK, 1);
    sheet.root.draw(&Rectangle::new([(left, top), (right, bottom)], ink))?;
    for &tick in &scale.axis.ticks {
        let y = at(scale.axis.share(tick));
        let end = right + sheet.px(5);
        sheet.line(&[(left, y), (end, y)], ink, &[])?;
        sheet.text(&Axis::label(tick), (end + sheet.px(5), y), TEXT, HPos::Left)?;
    }
    Ok(bottom)
}
