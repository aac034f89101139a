//! How the map looks.

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::SigmaMap;
use crate::report::axis::Axis;
use crate::report::colours::{self, FAINT, INK};
use crate::report::sheet::{Drawing, Drawn, Pixel, SMALL, Sheet, TEXT};

const WIDTH: u32 = 960;
const HEIGHT: u32 = 520;
const RIGHT: i32 = 170;
const TITLE_ROOM: i32 = 40;
const FOOT: i32 = 8;
const X_LABELS: i32 = 48;
const BAR_WIDTH: i32 = 24;
/// Distance of the hatching's lines, units.
const HATCH: usize = 12;
const HATCH_INK: RGBColor = RGBColor(205, 205, 205);

impl Drawing for SigmaMap {
    const WHAT: &'static str = "the map of sigma";
    const SIZE: (u32, u32) = (WIDTH, HEIGHT);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        sheet.title(&self.title, WIDTH as i32)?;
        let area =
            sheet.root.margin(sheet.px(TITLE_ROOM), sheet.px(FOOT), sheet.px(12), sheet.px(RIGHT));
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(X_LABELS))
            .y_label_area_size(sheet.px(66))
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        sheet
            .mesh(&mut chart, TEXT)
            .disable_mesh()
            .set_all_tick_mark_size(sheet.px(5))
            .x_desc("distance z (m)")
            .y_desc("tilt θ (degrees)")
            .draw()?;
        let at = |x: f64, y: f64| chart.backend_coord(&(x, y));
        self.outside(sheet, &at)?;
        self.surface(sheet, &at)?;
        self.measured(sheet, &at)?;
        self.iso_lines(sheet, &at)?;
        self.colour_bar(sheet)
    }
}

type At<'a> = &'a dyn Fn(f64, f64) -> Pixel;

impl SigmaMap {
    /// Hatching over the whole plot; the surface then covers the valid part.
    fn outside<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, at: At<'_>) -> Drawn<B> {
        let (left, bottom) = at(self.x.low, self.y.low);
        let (right, top) = at(self.x.high, self.y.high);
        let height = bottom - top;
        let style = sheet.stroke(&HATCH_INK, 1);
        for start in (left - height..right).step_by(HATCH * sheet.unit.unsigned_abs() as usize) {
            let [from, to] = [start.max(left), (start + height).min(right)];
            sheet.line(
                &[(from, bottom - (from - start)), (to, bottom - (to - start))],
                style,
                &[],
            )?;
        }
        Ok(())
    }

    fn surface<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, at: At<'_>) -> Drawn<B> {
        for run in &self.runs {
            let corners = [at(run.z_m[0], run.theta_deg[1]), at(run.z_m[1], run.theta_deg[0])];
            sheet.fill(corners, &colour(run.shade))?;
        }
        let [z, theta] = [self.valid_z_m, self.valid_theta_deg];
        let frame = Rectangle::new([at(z[0], theta[1]), at(z[1], theta[0])], sheet.stroke(&INK, 1));
        sheet.root.draw(&frame)
    }

    fn iso_lines<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, at: At<'_>) -> Drawn<B> {
        for line in &self.lines {
            for piece in &line.pieces {
                let ends = piece.map(|[z, theta]| at(z, theta));
                sheet.line(&ends, sheet.stroke(&INK, 1), &[])?;
            }
        }
        for line in &self.lines {
            let Some([z, theta]) = line.label_at else { continue };
            self.label(sheet, &Axis::label(line.sigma_mm), at(z, theta))?;
        }
        Ok(())
    }

    fn label<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, text: &str, at: Pixel) -> Drawn<B> {
        let half = [sheet.width(text, SMALL)? / 2 + sheet.px(3), sheet.px(8)];
        let corners = [(at.0 - half[0], at.1 - half[1]), (at.0 + half[0], at.1 + half[1])];
        sheet.fill(corners, &WHITE.mix(0.85))?;
        sheet.text(text, at, SMALL, HPos::Center)
    }

    fn measured<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, at: At<'_>) -> Drawn<B> {
        for [z, theta] in &self.cells {
            self.dot(sheet, at(*z, *theta))?;
        }
        Ok(())
    }

    fn dot<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, at: Pixel) -> Drawn<B> {
        sheet.root.draw(&Circle::new(at, sheet.px(3), WHITE.filled()))?;
        sheet.root.draw(&Circle::new(at, sheet.px(2), INK.filled()))
    }

    fn colour_bar<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        let left = sheet.px(WIDTH as i32 - RIGHT + 28);
        let right = left + sheet.px(BAR_WIDTH);
        let top = sheet.px(TITLE_ROOM + 26);
        let bottom = sheet.px(HEIGHT as i32 - FOOT - X_LABELS - 56);
        let height = |share: f64| bottom - (share * f64::from(bottom - top)).round() as i32;
        sheet.text("σ (mm)", (left, sheet.px(TITLE_ROOM + 10)), TEXT, HPos::Left)?;
        for shade in 0..Self::SHADES {
            let [low, high] = [shade, shade + 1].map(|s| height(s as f64 / Self::SHADES as f64));
            sheet.fill([(left, high), (right, low)], &colour(shade))?;
        }
        sheet.root.draw(&Rectangle::new([(left, top), (right, bottom)], sheet.stroke(&INK, 1)))?;
        for &tick in &self.sigma_mm.ticks {
            let y = height(self.sigma_mm.share(tick));
            let end = right + sheet.px(5);
            sheet.line(&[(left, y), (end, y)], sheet.stroke(&INK, 1), &[])?;
            sheet.text(&Axis::label(tick), (end + sheet.px(5), y), TEXT, HPos::Left)?;
        }
        self.key(sheet, left, bottom + sheet.px(30))
    }

    fn key<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, x: i32, y: i32) -> Drawn<B> {
        let next = y + sheet.px(22);
        self.dot(sheet, (x + sheet.px(5), y))?;
        sheet.coloured_text("measured", (x + sheet.px(18), y), SMALL, HPos::Left, &FAINT)?;
        let [left, right] = [x, x + sheet.px(12)];
        for shift in [-4, 2, 8] {
            let y = next + sheet.px(shift);
            let ends = [(left, y), (right, y - sheet.px(6))];
            sheet.line(&ends, sheet.stroke(&FAINT, 1), &[])?;
        }
        sheet.coloured_text("not measured", (x + sheet.px(18), next), SMALL, HPos::Left, &FAINT)
    }
}

fn colour(shade: usize) -> RGBColor {
    colours::surface((shade as f64 + 0.5) / SigmaMap::SHADES as f64)
}
