//! Gains of all methods, a dot a set.

use std::collections::BTreeMap;

use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::gains::rank;
use crate::{ProvenSet, Ratio, scores, worth};
use kinoise::error::Result;
use kinoise::report::axis::Axis;
use kinoise::report::colours::{FAINT, GRID, INK};
use kinoise::report::sheet::{self, Drawing, Drawn, Pixel, SMALL, Sheet, TEXT};
use kinoise::stats::quantile;

/// Sorted gains over the oracle's, within and beyond.
type Both = [Vec<f64>; 2];

/// By method, in their order.
pub(super) struct Strips(Vec<(String, Both)>);

impl Strips {
    /// `None` where nothing was gained that could be compared.
    pub fn of(sets: &[ProvenSet]) -> Option<Self> {
        let mut methods: BTreeMap<(usize, String), Both> = BTreeMap::new();
        for set in sets.iter().filter(|s| s.gains.is_some() && worth(&s.truth)) {
            // The judge's own ratio, of one set.
            for (name, learnt) in scores(&[set.judged()]).learnt {
                let both = methods.entry((rank(&name), name)).or_default();
                let ratios = [learnt.within, learnt.beyond];
                for (all, one) in both.iter_mut().zip(ratios) {
                    all.extend(one.map(|r: Ratio| r.median).filter(|v| v.is_finite()));
                }
            }
        }
        let sorted = |mut both: Both| {
            both.iter_mut().for_each(|b| b.sort_by(f64::total_cmp));
            both
        };
        let all: Vec<_> = methods.into_iter().map(|((_, name), b)| (name, sorted(b))).collect();
        all.iter().any(|(_, b)| b.iter().any(|v| !v.is_empty())).then_some(Strips(all))
    }

    pub fn svg(&self) -> Result<String> {
        sheet::svg(self)
    }
}

const WIDTH: u32 = 960;
const HEIGHT: u32 = 400;
const NAMES: i32 = 170;
const GAP: i32 = 24;
const TOP: i32 = 34;
const BOTTOM: i32 = 48;
/// Half the height of a box, and of the band of dots, units.
const BOX: i32 = 8;
const SPREAD: i32 = 13;
const DOT: i32 = 2;
const LOW: f64 = -1.1;
const HIGH: f64 = 1.4;
const BLUE: RGBColor = RGBColor(0x1d, 0x91, 0xc0);
const HEADS: [&str; 2] = ["views like the recording’s", "views outside it"];

/// From a value and the middle of a row to a place.
type Place<'a> = &'a dyn Fn(f64) -> i32;

impl Strips {
    fn panel<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, side: usize) -> Drawn<B> {
        let width = (WIDTH as i32 - NAMES - 2 * GAP) / 2;
        let left = NAMES + (width + GAP) * side as i32;
        let [top, bottom, left, width] =
            [TOP, HEIGHT as i32 - BOTTOM, left, width].map(|u| sheet.px(u));
        let mut axis = Axis::linear(LOW, HIGH);
        axis.ticks = vec![-1.0, -0.5, 0.0, 0.5, 1.0];
        let place =
            |v: f64| left + (axis.share(v.clamp(LOW, HIGH)) * f64::from(width)).round() as i32;
        sheet.text(HEADS[side], (left, top - sheet.px(16)), TEXT, HPos::Left)?;
        for tick in &axis.ticks {
            let x = place(*tick);
            let style = if *tick == 0.0 || *tick == 1.0 {
                sheet.stroke(&FAINT, 1)
            } else {
                sheet.stroke(&GRID, 1)
            };
            sheet.line(&[(x, top), (x, bottom)], style, &[])?;
            sheet.text(&Axis::label(*tick), (x, bottom + sheet.px(14)), SMALL, HPos::Center)?;
        }
        let middle = left + width / 2;
        sheet.text(
            "gain over the oracle’s",
            (middle, bottom + sheet.px(34)),
            SMALL,
            HPos::Center,
        )?;
        let row = (bottom - top) / self.0.len().max(1) as i32;
        for (i, (name, both)) in self.0.iter().enumerate() {
            let y = top + row / 2 + row * i as i32;
            if side == 0 {
                let at = (sheet.px(NAMES - 12), y);
                sheet.text(name, at, SMALL, HPos::Right)?;
            }
            strip(sheet, &both[side], y, &place)?;
        }
        Ok(())
    }
}

fn strip<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    sorted: &[f64],
    y: i32,
    place: Place<'_>,
) -> Drawn<B> {
    for (i, v) in sorted.iter().enumerate().filter(|(_, v)| (LOW..=HIGH).contains(*v)) {
        // Neighbours in value lie apart.
        let off = (i * 5 % 9) as i32 - 4;
        let at = (place(*v), y + sheet.px(SPREAD) * off / 4);
        sheet.root.draw(&Circle::new(at, sheet.px(DOT), BLUE.mix(0.45).filled()))?;
    }
    let mut values = sorted.to_vec();
    let Some(five) = [0.1, 0.25, 0.5, 0.75, 0.9]
        .map(|p| quantile(&mut values, p))
        .into_iter()
        .collect::<Option<Vec<f64>>>()
    else {
        return Ok(());
    };
    let x: Vec<i32> = five.iter().map(|v| place(*v)).collect();
    let half = sheet.px(BOX);
    let ink = sheet.stroke(&INK, 1);
    let line = |a: Pixel, b: Pixel| sheet.line(&[a, b], ink, &[]);
    line((x[0], y), (x[1], y))?;
    line((x[3], y), (x[4], y))?;
    sheet.root.draw(&Rectangle::new([(x[1], y - half), (x[3], y + half)], ink))?;
    sheet.line(&[(x[2], y - half), (x[2], y + half)], sheet.stroke(&INK, 3), &[])?;
    let low = sorted.iter().filter(|v| **v < LOW).count();
    let high = sorted.iter().filter(|v| **v > HIGH).count();
    let above = y - sheet.px(BOX + 8);
    if low > 0 {
        sheet.coloured_text(
            &format!("← {low}"),
            (place(LOW), above),
            SMALL - 2,
            HPos::Left,
            &FAINT,
        )?;
    }
    if high > 0 {
        sheet.coloured_text(
            &format!("{high} →"),
            (place(HIGH), above),
            SMALL - 2,
            HPos::Right,
            &FAINT,
        )?;
    }
    Ok(())
}

impl Drawing for Strips {
    const WHAT: &'static str = "the gains by method";
    const SIZE: (u32, u32) = (WIDTH, HEIGHT);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        self.panel(sheet, 0)?;
        self.panel(sheet, 1)
    }
}
