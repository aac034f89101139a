//! From values to places: how each layer looks.

use std::f64::consts::PI;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::sheet::{Drawn, Pixel, SMALL, Sheet};
use super::{Layer, Mark, Stroke};
use crate::report::axis::Axis;
use crate::report::colours::INK;

/// Half the width of an error bar's ends, units.
const CAP: i32 = 3;
/// Half the length of the stroke that a line of one point becomes, units.
const HALF_STROKE: i32 = 17;
/// From one line of the hatching to the next, units.
pub(super) const HATCH: i32 = 12;
const HATCH_INK: RGBColor = RGBColor(205, 205, 205);

/// A sheet with axes.
pub(super) struct Plot<'a, B: DrawingBackend> {
    pub sheet: &'a Sheet<'a, B>,
    pub x: &'a Axis,
    pub y: &'a Axis,
    /// Where the axes' low ends and their high ends are.
    pub low: Pixel,
    pub high: Pixel,
}

impl<B: DrawingBackend> Plot<'_, B> {
    pub fn at(&self, x: f64, y: f64) -> Pixel {
        let along =
            |low: i32, high: i32, share: f64| low + (share * f64::from(high - low)).round() as i32;
        let (u, v) = (self.x.share(x), self.y.share(y));
        (along(self.low.0, self.high.0, u), along(self.low.1, self.high.1, v))
    }

    fn inside(&self, [x, y]: &[f64; 2]) -> Option<Pixel> {
        (self.x.contains(*x) && self.y.contains(*y)).then(|| self.at(*x, *y))
    }

    fn clamped(&self, x: f64, y: f64) -> Pixel {
        self.at(x, y.clamp(self.y.low, self.y.high))
    }

    pub fn layer(&self, layer: &Layer) -> Drawn<B> {
        match layer {
            Layer::Line(points, stroke) => self.line(points, *stroke),
            Layer::Band(edges, colour) => self.band(edges, *colour),
            Layer::ErrorBars(bars, stroke) => {
                bars.iter().try_for_each(|bar| self.error_bar(*bar, *stroke))
            }
            Layer::Marks(points, mark) => {
                let mut inside = points.iter().filter_map(|p| self.inside(p));
                inside.try_for_each(|at| draw_mark(self.sheet, at, *mark))
            }
            Layer::Tile(x, y, colour) => {
                self.sheet.fill([self.at(x[0], y[1]), self.at(x[1], y[0])], colour)
            }
            Layer::Hatching => self.hatching(),
            Layer::Label([x, y], text) => self.label(self.at(*x, *y), text),
        }
    }

    fn line(&self, points: &[[f64; 2]], stroke: Stroke) -> Drawn<B> {
        let places: Vec<Option<Pixel>> = points.iter().map(|p| self.inside(p)).collect();
        for part in places.split(Option::is_none) {
            let part: Vec<Pixel> = part.iter().flatten().copied().collect();
            match part[..] {
                [] => {}
                [(x, y)] => {
                    let half = self.sheet.px(HALF_STROKE);
                    self.sheet.line(&[(x - half, y), (x + half, y)], stroke)?;
                }
                _ => self.sheet.line(&part, stroke)?,
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
        self.sheet.line(&ends, stroke)?;
        let cap = self.sheet.px(CAP);
        ends.iter().try_for_each(|&(u, v)| self.sheet.line(&[(u - cap, v), (u + cap, v)], stroke))
    }

    fn hatching(&self) -> Drawn<B> {
        let ((left, bottom), (right, top)) = (self.low, self.high);
        let height = bottom - top;
        for start in (left - height..right).step_by(self.sheet.px(HATCH).unsigned_abs() as usize) {
            let ends = [start.max(left), (start + height).min(right)];
            let ends = ends.map(|u| (u, bottom - (u - start)));
            self.sheet.line(&ends, Stroke::new(HATCH_INK, 1))?;
        }
        Ok(())
    }

    fn label(&self, (u, v): Pixel, text: &str) -> Drawn<B> {
        let sheet = self.sheet;
        let half = [sheet.width(text, SMALL)? / 2 + sheet.px(3), sheet.px(8)];
        let corners = [(u - half[0], v - half[1]), (u + half[0], v + half[1])];
        sheet.fill(corners, &WHITE.mix(0.85))?;
        sheet.text(text, (u, v), SMALL, HPos::Center, &INK)
    }
}

pub(super) fn draw_mark<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    at: Pixel,
    mark: Mark,
) -> Drawn<B> {
    let radius = sheet.px(mark.radius);
    let Some(shape) = mark.shape.checked_sub(1) else {
        sheet.root.draw(&Circle::new(at, radius, mark.fill.filled()))?;
        return sheet.root.draw(&Circle::new(at, radius, sheet.style(&mark.edge, 1)));
    };
    let mut corners = corners(SHAPES[shape % SHAPES.len()], at, f64::from(radius));
    sheet.root.draw(&Polygon::new(corners.clone(), mark.fill.filled()))?;
    corners.push(corners[0]);
    sheet.line(&corners, Stroke::new(mark.edge, 1))
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
