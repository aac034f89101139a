//! How Fig. 2 looks.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::marks::draw_mark;
use super::{Figure2, Group, Overlay, OverlayLine, Point};
use crate::report::axis::Axis;
use crate::report::colours::{self, FAINT, INK};
use crate::report::sheet::{Chart, Dashes, Drawing, Drawn, Pixel, SMALL, Sheet, TEXT};
use crate::units::decimals;

const WIDTH: u32 = 960;
const HEIGHT: u32 = 560;
/// Column for the legend, right of the data, units.
const LEGEND: i32 = 222;
const TITLE_ROOM: i32 = 40;
const LINE: i32 = 26;
const SAMPLE: i32 = 34;
const BAND_OPACITY: f64 = 0.16;
/// Half the width of an error bar's ends, units.
const CAP: i32 = 3;
/// With more points than this markers shrink.
const MANY_POINTS: usize = 120;
/// Radius of the mark that tells an overlay's distance, units.
const OPEN_MARK: i32 = 4;

impl Drawing for Figure2 {
    const WHAT: &'static str = "figure 2";
    const SIZE: (u32, u32) = (WIDTH, HEIGHT);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        sheet.title(&self.title, WIDTH as i32)?;
        let area =
            sheet.root.margin(sheet.px(TITLE_ROOM), sheet.px(10), sheet.px(12), sheet.px(LEGEND));
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(48))
            .y_label_area_size(sheet.px(66))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        axes(sheet, &mut chart)?;
        let at = |x, y| chart.backend_coord(&(x, y));
        let plot = Plot { sheet, x: &self.x, y: &self.y, at: &at };
        for (i, group) in self.groups.iter().enumerate() {
            plot.band(group, self.colour(i))?;
        }
        for line in &self.lines {
            self.overlay(&plot, line)?;
        }
        for (i, group) in self.groups.iter().enumerate() {
            plot.curve(group, self.colour(i))?;
        }
        for (i, group) in self.groups.iter().enumerate() {
            for point in &group.points {
                self.error_bar(&plot, point, i)?;
            }
        }
        for (i, group) in self.groups.iter().enumerate() {
            for point in &group.points {
                if let Some(at) = plot.inside(point.theta_deg, point.sigma_mm) {
                    self.marker(sheet, at, i)?;
                }
            }
        }
        self.legend(sheet)
    }
}

fn axes<B: DrawingBackend>(sheet: &Sheet<'_, B>, chart: &mut Chart<'_, B, Axis, Axis>) -> Drawn<B> {
    sheet
        .mesh(chart, TEXT)
        .set_all_tick_mark_size(sheet.px(5))
        .x_desc("tilt θ (degrees)")
        .y_desc("σ (mm)")
        .draw()
}

/// A sheet with axes: from values to places; what falls outside the axes is not drawn.
struct Plot<'a, B: DrawingBackend> {
    sheet: &'a Sheet<'a, B>,
    x: &'a Axis,
    y: &'a Axis,
    at: &'a dyn Fn(f64, f64) -> Pixel,
}

impl<B: DrawingBackend> Plot<'_, B> {
    fn inside(&self, x: f64, y: f64) -> Option<Pixel> {
        (self.x.contains(x) && self.y.contains(y)).then(|| (self.at)(x, y))
    }

    fn clamped(&self, x: f64, y: f64) -> Pixel {
        (self.at)(x, y.clamp(self.y.low, self.y.high))
    }

    /// Draw the parts of a line that lie inside; a lone point becomes a short stroke.
    fn follow(&self, line: &[[f64; 2]], style: ShapeStyle, dashes: Dashes) -> Drawn<B> {
        let places: Vec<Option<Pixel>> = line.iter().map(|[x, y]| self.inside(*x, *y)).collect();
        for part in places.split(Option::is_none) {
            let part: Vec<Pixel> = part.iter().flatten().copied().collect();
            match part[..] {
                [] => {}
                [(x, y)] => {
                    let reach = self.sheet.px(SAMPLE / 2);
                    self.sheet.line(&[(x - reach, y), (x + reach, y)], style, dashes)?;
                }
                _ => self.sheet.line(&part, style, dashes)?,
            }
        }
        Ok(())
    }

    fn band(&self, group: &Group, colour: RGBColor) -> Drawn<B> {
        let there = group.curve.iter().map(|[x, _, low, _]| self.clamped(*x, *low));
        let back = group.curve.iter().rev().map(|[x, _, _, high]| self.clamped(*x, *high));
        let outline: Vec<Pixel> = there.chain(back).collect();
        if group.curve.len() < 2 {
            return Ok(());
        }
        self.sheet.root.draw(&Polygon::new(outline, colour.mix(BAND_OPACITY)))
    }

    fn curve(&self, group: &Group, colour: RGBColor) -> Drawn<B> {
        let line: Vec<[f64; 2]> = group.curve.iter().map(|[x, y, _, _]| [*x, *y]).collect();
        self.follow(&line, self.sheet.stroke(&colour, 2), &[])
    }
}

fn dashes(overlay: Overlay) -> Dashes {
    match overlay {
        Overlay::PaperEq1 => &[9, 5],
        Overlay::Nguyen => &[2, 4],
        Overlay::Khoshelham => &[12, 4, 2, 4],
    }
}

impl Figure2 {
    fn colour(&self, group: usize) -> RGBColor {
        colours::distance(group as f64 / (self.groups.len().max(2) - 1) as f64)
    }

    /// In its distance's colour, which a mark at its squarest end tells where colours are lost.
    fn overlay<B: DrawingBackend>(&self, plot: &Plot<'_, B>, line: &OverlayLine) -> Drawn<B> {
        let colour = colours::darker(self.colour(line.group));
        plot.follow(&line.line, plot.sheet.stroke(&colour, 1), dashes(line.overlay))?;
        let first = line.line.iter().find_map(|[x, y]| plot.inside(*x, *y));
        let Some((x, y)) = first else { return Ok(()) };
        let beside = (x - plot.sheet.px(OPEN_MARK + 3), y);
        let (edge, fill) = (plot.sheet.stroke(&colour, 1), WHITE.filled());
        draw_mark(plot.sheet, beside, line.group, plot.sheet.px(OPEN_MARK), [fill, edge])
    }

    fn error_bar<B: DrawingBackend>(
        &self,
        plot: &Plot<'_, B>,
        point: &Point,
        group: usize,
    ) -> Drawn<B> {
        let sheet = plot.sheet;
        let (x, y) = (point.theta_deg, point.sigma_mm);
        let (Some(error), Some(_)) = (point.std_error_mm, plot.inside(x, y)) else {
            return Ok(());
        };
        let style = sheet.stroke(&self.colour(group), 1);
        let ends = [y - error, y + error].map(|v| plot.clamped(x, v));
        sheet.line(&ends, style, &[])?;
        let cap = sheet.px(CAP);
        for (u, v) in ends {
            sheet.line(&[(u - cap, v), (u + cap, v)], style, &[])?;
        }
        Ok(())
    }

    /// Colour and shape of the group, with an edge that fades where many crowd.
    fn marker<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, at: Pixel, group: usize) -> Drawn<B> {
        let crowded = self.groups.iter().map(|g| g.points.len()).sum::<usize>() > MANY_POINTS;
        let (radius, opacity) = if crowded { (4, 0.6) } else { (5, 1.0) };
        let edge = sheet.stroke(&INK.mix(opacity), 1);
        let fill = self.colour(group).filled();
        draw_mark(sheet, at, group, sheet.px(radius), [fill, edge])
    }

    fn legend<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        let x = sheet.px(WIDTH as i32 - LEGEND + 22);
        let mut y = sheet.px(TITLE_ROOM + 18);
        let mut next = |lines_tenths: i32| {
            let at = y;
            y += sheet.px(LINE) * lines_tenths / 10;
            at
        };
        let text_x = x + sheet.px(SAMPLE + 10);
        sheet.text("distance z", (x, next(10)), TEXT, HPos::Left)?;
        for (i, group) in self.groups.iter().enumerate() {
            let y = next(10);
            let sample = [(x, y), (x + sheet.px(SAMPLE), y)];
            sheet.line(&sample, sheet.stroke(&self.colour(i), 2), &[])?;
            self.marker(sheet, (x + sheet.px(SAMPLE / 2), y), i)?;
            sheet.text(&label(group), (text_x, y), TEXT, HPos::Left)?;
        }
        next(5);
        let y = next(10);
        let half = sheet.px(7);
        sheet.fill([(x, y - half), (x + sheet.px(SAMPLE), y + half)], &INK.mix(BAND_OPACITY))?;
        sheet.line(&[(x, y), (x + sheet.px(SAMPLE), y)], sheet.stroke(&INK, 2), &[])?;
        sheet.text("fit, 95 % band", (text_x, y), SMALL, HPos::Left)?;
        for &overlay in &self.overlays {
            let y = next(10);
            let sample = [(x, y), (x + sheet.px(SAMPLE), y)];
            sheet.line(&sample, sheet.stroke(&INK, 1), dashes(overlay))?;
            sheet.text(overlay.label(), (text_x, y), SMALL, HPos::Left)?;
            if !self.lines.iter().any(|l| l.overlay == overlay) {
                self.aside(sheet, "(nothing measured here)", (text_x, next(8)))?;
            }
        }
        if !self.lines.is_empty() {
            self.aside(sheet, "open marks: their distance", (x, next(10)))?;
        }
        self.key_to_points(sheet, (x, next(10)))
    }

    fn key_to_points<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, (x, y): Pixel) -> Drawn<B> {
        let bars = self.groups.iter().flat_map(|g| &g.points).any(|p| p.std_error_mm.is_some());
        let words = if bars { "points: measured ± 1 s.e.," } else { "points: measured," };
        self.aside(sheet, words, (x, y))?;
        self.aside(sheet, "carried to the curve's distance", (x, y + sheet.px(LINE) * 8 / 10))
    }

    fn aside<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, words: &str, at: Pixel) -> Drawn<B> {
        sheet.coloured_text(words, at, SMALL, HPos::Left, &FAINT)
    }
}

/// Distances that print alike are one.
fn label(group: &Group) -> String {
    let [low, high] = group.range_m.map(|z| decimals(z, 2));
    if low == high {
        format!("{low} m")
    } else {
        let [low, high] = group.range_m.map(|z| decimals(z, 1));
        format!("{} m ({low} – {high})", decimals(group.z_m, 2))
    }
}
