//! Whether stated probabilities come true.

use maud::{Markup, PreEscaped, html};
use plotters::prelude::*;
use plotters::style::text_anchor::HPos;

use super::words::{percents, ratio};
use crate::{Bin, Certainty, Scores};
use kinoise::error::Result;
use kinoise::report::axis::Axis;
use kinoise::report::colours::FAINT;
use kinoise::report::numbers::{ABSENT, fixed};
use kinoise::report::sheet::{self, Drawing, Drawn, SMALL, Sheet};
use kinoise::stats::clopper_pearson;

pub(super) fn section(scores: &Scores) -> Result<Markup> {
    let both = [
        ("Best names", "the best name of every finding", &scores.certainty),
        (
            "All names offered",
            "every name offered, alternatives included",
            &scores.certainty_of_all,
        ),
    ];
    let figures = both.map(|(_, _, c)| sheet::svg(&Reliability { bins: &c.bins }));
    Ok(html! {
        section {
            h2 { "Do the stated probabilities come true?" }
            div.halves { @for ((title, what, certainty), figure) in both.iter().zip(figures) { figure {
                h3 { (title) }
                p { (certainty.n) " probabilities: " (what) ". ECE " b { (number(certainty.ece)) } ", Brier score " b { (number(certainty.brier)) } "." }
                div.drawing role="img" aria-label={ "Reliability diagram: " (what) } { (PreEscaped(figure?)) }
                (table(certainty))
            } } }
            p.note {
                "On the diagonal, names stated with 70 % are right in 70 of 100 cases; below it the program is surer than it should be. The number above each \
                 point counts the names in its tenth; bars are 95 % intervals. ECE: mean distance from the diagonal, by count. Brier: mean \
                 square of probability less outcome."
            }
        }
    })
}

fn number(value: Option<f64>) -> String {
    value.map_or(ABSENT.into(), |v| fixed(v, 3))
}

/// Names of a tenth that were right, and their share's interval.
fn interval(bin: &Bin) -> (usize, [f64; 2]) {
    let right = (bin.right * bin.n as f64).round() as usize;
    (right, clopper_pearson(right, bin.n, 0.95))
}

fn table(certainty: &Certainty) -> Markup {
    html! { table.small.rates {
        thead { tr { th { "Stated" } th.n { "names" } th.n { "mean stated" } th.n { "right" } th.n { "95 % interval" } } }
        tbody { @for bin in &certainty.bins {
            @let (right, ends) = interval(bin);
            tr {
                td { (fixed(bin.low, 1)) " to " (fixed(bin.high, 1)) }
                td.n { (bin.n) }
                td.n { (ratio(bin.stated)) }
                td.n { (right) " = " (ratio(bin.right)) }
                td.n { (percents(ends)) }
            }
        } }
    } }
}

struct Reliability<'a> {
    bins: &'a [Bin],
}

const SIDE: u32 = 440;
/// Room for the counts, units.
const TOP: i32 = 26;
const DOT: i32 = 5;
const CAP: i32 = 4;
const BLUE: RGBColor = RGBColor(0x1d, 0x91, 0xc0);

impl Drawing for Reliability<'_> {
    const WHAT: &'static str = "the reliability diagram";
    const SIZE: (u32, u32) = (SIDE, SIDE);

    fn draw<B: DrawingBackend>(&self, sheet: &Sheet<'_, B>) -> Drawn<B> {
        let [top, bottom, left, right] = [TOP, 6, 8, 16].map(|u| sheet.px(u));
        let area = sheet.root.margin(top, bottom, left, right);
        // Room for points on the border.
        let mut axis = Axis::linear(-0.03, 1.03);
        axis.ticks = vec![0.0, 0.2, 0.4, 0.6, 0.8, 1.0];
        let mut chart = ChartBuilder::on(&area)
            .x_label_area_size(sheet.px(46))
            .y_label_area_size(sheet.px(60))
            .build_cartesian_2d(axis.clone(), axis)?;
        sheet
            .mesh(&mut chart, SMALL)
            .set_all_tick_mark_size(sheet.px(4))
            .x_desc("probability stated")
            .y_desc("share that was right")
            .draw()?;
        let at = |x: f64, y: f64| chart.backend_coord(&(x, y));
        sheet.line(&[at(0.0, 0.0), at(1.0, 1.0)], sheet.stroke(&FAINT, 1), &[5, 4])?;
        let ink = sheet.stroke(&BLUE, 2);
        for bin in self.bins {
            let ends = interval(bin).1.map(|y| at(bin.stated, y));
            sheet.line(&ends, ink, &[])?;
            for (x, y) in ends {
                sheet.line(&[(x - sheet.px(CAP), y), (x + sheet.px(CAP), y)], ink, &[])?;
            }
            let (x, y) = at(bin.stated, bin.right);
            sheet.root.draw(&Circle::new((x, y), sheet.px(DOT), BLUE.filled()))?;
            let above = (x, sheet.px(TOP / 2));
            sheet.text(&bin.n.to_string(), above, SMALL - 2, HPos::Center)?;
        }
        Ok(())
    }
}
