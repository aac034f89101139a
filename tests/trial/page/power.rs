//! Detection and naming against strength: single causes of each world, in and outside the catalogue.

use maud::{Markup, PreEscaped, html};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::multiples;
use super::words::{of, percents};
use crate::{Cell, LEVELS, Proof, ProvenSet, Rate, Truth, World, level};
use kinoise::error::Result;
use kinoise::report::axis::Axis;
use kinoise::report::colours::FAINT;
use kinoise::report::numbers::ABSENT;
use kinoise::report::sheet::{self, Chart, Dashes, Drawing, Drawn, SMALL, Sheet, TEXT};

/// Rates by strength, of one mark.
pub(super) type Line = Vec<(f64, Rate)>;

/// Of these sets, one mark in order of strength.
pub(super) fn line_of<'a>(sets: impl Iterator<Item = &'a ProvenSet>, mark: &str) -> Line {
    let mut answers: Vec<(f64, Vec<bool>)> = Vec::new();
    for set in sets {
        let all = set.marks.yes_no();
        let answer = all.iter().find(|m| m.0 == mark).and_then(|m| m.1);
        let (Some(level), Some(answer)) = (level(&set.truth), answer) else { continue };
        match answers.iter_mut().find(|a| a.0 == level) {
            Some(of) => of.1.push(answer),
            None => answers.push((level, vec![answer])),
        }
    }
    let mut line: Line =
        answers.into_iter().filter_map(|(l, a)| Some((l, Rate::of(a.into_iter())?))).collect();
    line.sort_by(|a, b| a.0.total_cmp(&b.0));
    line
}

/// The marks that are shown: their name, above the panel.
const MARKS: [(&str, &str); 2] =
    [("detected", "Detected, %"), ("first_name", "First name right, of those detected, %")];

pub(super) fn section(proof: &Proof) -> Result<Markup> {
    let of = |w: World, c: Cell, named: bool| {
        let single = |s: &&ProvenSet| {
            let Truth { asked, hidden, .. } = &s.truth;
            (asked.world, asked.cell) == (w, c)
                && hidden.iter().any(|h| !h.names.is_empty()) == named
        };
        MARKS.map(|(mark, _)| line_of(proof.sets.iter().filter(single), mark))
    };
    let rays = of(World::Rays, Cell::Single, true);
    let outside = of(World::Rays, Cell::Outside, false);
    let light = of(World::Light, Cell::Single, true);
    let nameless = of(World::Light, Cell::Single, false);
    let nothing = [&rays, &outside, &light].iter().all(|l| l[0].is_empty());
    let figure = PowerFigure { rays: rays.clone(), outside: outside.clone(), light: light.clone() };
    let caption = "Single causes by what they are worth: of the catalogue, and outside it, made by rays; by light. Bands: 95 % intervals of Clopper and \
                   Pearson over the causes of the catalogue. Short grey strokes: the plan’s marks “good” and “extraordinary”.";
    Ok(html! {
        section {
            h2 { "How strong a cause must be" }
            @if nothing { p { "No set hides a single cause of a stated strength." } } @else {
                p {
                    "A cause is worth so many " b { "nats" } " as who knows it gains in log-likelihood over the whole recording. That is a strict measure: "
                    b { "in a recording of a million readings, a bias of 1 % of the noise already makes 50 nats" }
                    ", and one of 10 % makes 5000. Nobody’s map is the worse for 15 nats; the right end is what a user would care about."
                }
                figure {
                    div.wide role="img" aria-label=(caption) { (PreEscaped(figure.svg()?)) }
                    figcaption { (caption) " In the world of light the strength is one of three sizes ordered (15, 50, 150), not measured in nats: its \
                        line does not stand beside the others at the same worth." }
                }
                (table(&[("rays (S1), catalogue", &rays), ("rays (S1), outside it", &outside), ("light (S2), catalogue", &light), ("light (S2), outside it", &nameless)]))
                (multiples::section(&proof.sets))
            }
        }
    })
}

fn table(lines: &[(&str, &[Line; 2])]) -> Markup {
    let mut levels: Vec<f64> = lines.iter().flat_map(|l| &l.1[0]).map(|p| p.0).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    let at = |line: &Line, nats: f64| line.iter().find(|p| p.0 == nats).map(|p| p.1);
    html! {
        div.wide { table.small.rates {
            thead { tr { th { "Nats, or size" } th {} @for nats in &levels { th.n { (Axis::label(*nats)) } } } }
            tbody { @for (name, both) in lines { @for (line, (_, mark)) in both.iter().zip(MARKS) {
                @if !line.is_empty() { tr {
                    th scope="row" { (name) }
                    td { (mark.trim_end_matches(", %")) }
                    @for nats in &levels { td.n { @match at(line, *nats) {
                        Some(rate) => { (of(&rate)) br; span.units { (percents(rate.interval)) } },
                        None => (ABSENT),
                    } } }
                } }
            } } }
        } }
    }
}

/// Lines of both marks.
struct PowerFigure {
    rays: [Line; 2],
    outside: [Line; 2],
    light: [Line; 2],
}

const WIDTH: u32 = 960;
const HEIGHT: u32 = 400;
/// Where a panel's head is, and where the plot begins, units.
const HEAD: i32 = 18;
const TOP: i32 = 36;
const LEGEND: i32 = 30;
const SAMPLE: i32 = 30;
const BAND_OPACITY: f64 = 0.18;
const DOT: i32 = 4;
/// Nats at both ends of the axis.
const ENDS: [f64; 2] = [4.0, 6300.0];
/// Half the length of a mark, as a factor in nats.
const REACH: f64 = 1.18;
const BLUE: RGBColor = RGBColor(0x1d, 0x91, 0xc0);
const DARK: RGBColor = RGBColor(0x41, 0x44, 0x87);
const RUST: RGBColor = RGBColor(0xb3, 0x58, 0x06);
/// Nats and percent of the plan's marks, panel by panel.
const GOALS: [&[(f64, f64)]; 2] = [
    &[(15.0, 50.0), (15.0, 80.0), (50.0, 95.0), (50.0, 99.0)],
    &[
        (50.0, 80.0),
        (50.0, 90.0),
        (150.0, 80.0),
        (150.0, 90.0),
        (500.0, 80.0),
        (500.0, 90.0),
        (5000.0, 80.0),
        (5000.0, 90.0),
    ],
];

impl PowerFigure {
    fn svg(&self) -> Result<String> {
        sheet::svg(self)
    }

    fn panel<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>, i: usize) -> Drawn<B> {
        let half = WIDTH as i32 / 2;
        let (left, right) = (half * i as i32, half * (1 - i as i32));
        sheet.text(MARKS[i].1, (sheet.px(left + 12), sheet.px(HEAD)), TEXT, HPos::Left)?;
        let [top, bottom, l, r] = [TOP, LEGEND, left + 6, right + 16].map(|u| sheet.px(u));
        let area = sheet.root.margin(top, bottom, l, r);
        let mut x = Axis::log(ENDS[0], ENDS[1]);
        x.ticks = LEVELS.to_vec();
        let mut y = Axis::linear(0.0, 100.0);
        y.ticks.retain(|t| (t / 20.0).fract() == 0.0);
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(46))
            .y_label_area_size(sheet.px(44))
            .build_cartesian_2d(x, y)?;
        sheet
            .mesh(&mut chart, SMALL)
            .set_all_tick_mark_size(sheet.px(4))
            .x_desc("nats over the whole recording (light: size)")
            .draw()?;
        for (nats, percent) in GOALS[i] {
            let ends = [nats / REACH, nats * REACH].map(|x| chart.backend_coord(&(x, *percent)));
            sheet.line(&ends, sheet.stroke(&FAINT, 2), &[])?;
        }
        draw(sheet, &chart, &self.light[i], &RUST, &[2, 3], false)?;
        draw(sheet, &chart, &self.outside[i], &DARK, &[7, 4], false)?;
        draw(sheet, &chart, &self.rays[i], &BLUE, &[], true)
    }
}

fn draw<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    chart: &Chart<'_, B, Axis, Axis>,
    line: &Line,
    colour: &RGBColor,
    dashes: Dashes,
    band: bool,
) -> Drawn<B> {
    let at = |nats: f64, share: f64| chart.backend_coord(&(nats, 100.0 * share));
    let points: Vec<_> = line.iter().map(|(nats, r)| at(*nats, r.rate)).collect();
    if band && line.len() > 1 {
        let there = line.iter().map(|(nats, r)| at(*nats, r.interval[0]));
        let back = line.iter().rev().map(|(nats, r)| at(*nats, r.interval[1]));
        let outline: Vec<_> = there.chain(back).collect();
        sheet.root.draw(&Polygon::new(outline, colour.mix(BAND_OPACITY).filled()))?;
    }
    sheet.line(&points, sheet.stroke(colour, if band { 3 } else { 2 }), dashes)?;
    let dot = sheet.px(if band { DOT } else { DOT - 1 });
    for point in points {
        sheet.root.draw(&Circle::new(point, dot, colour.filled()))?;
    }
    Ok(())
}

impl Drawing for PowerFigure {
    const WHAT: &'static str = "the power curves";
    const SIZE: (u32, u32) = (WIDTH, HEIGHT);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        self.panel(sheet, 0)?;
        self.panel(sheet, 1)?;
        let legend: [(&str, &[Line; 2], RGBColor, Dashes); 3] = [
            ("rays (S1), of the catalogue", &self.rays, BLUE, &[]),
            ("rays (S1), outside it", &self.outside, DARK, &[7, 4]),
            ("light (S2), of the catalogue, by size", &self.light, RUST, &[2, 3]),
        ];
        let y = sheet.px(HEIGHT as i32 - LEGEND / 2);
        let mut x = sheet.px(60);
        for (name, lines, colour, dashes) in legend {
            if lines[0].is_empty() {
                continue;
            }
            let end = x + sheet.px(SAMPLE);
            sheet.line(&[(x, y), (end, y)], sheet.stroke(&colour, 3), dashes)?;
            sheet.text(name, (end + sheet.px(7), y), SMALL, HPos::Left)?;
            x = end + sheet.width(name, SMALL)? + sheet.px(30);
        }
        Ok(())
    }
}
