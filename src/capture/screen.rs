//! The screen as text: big letters for the person with the board, a map of what is wanted.

use font8x8::{BASIC_FONTS, LATIN_FONTS, UnicodeFonts};

use super::advice::{Advice, far_side};
use super::guide::Guide;
use super::wanted::{ViewState, Wanted, WantedView};

/// How a line is emphasised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    Plain,
    /// The instruction.
    Loud,
    /// A view was just taken: the whole screen flashes.
    Flash,
}

/// One line of the screen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    pub text: String,
    pub style: Style,
}

/// What the screen shows besides the guide's state.
#[derive(Debug, Clone, Default)]
pub struct Status {
    /// The recording and its sensor.
    pub title: String,
    /// The view that was just taken.
    pub flash: Option<String>,
    /// The latest message.
    pub news: String,
    /// Seconds since the last frame, if that is long.
    pub silent_s: Option<u64>,
}

/// Columns of the bar that fills while the target is still.
const BAR: usize = 20;
/// Columns of one cell of the map.
const CELL: usize = 5;
const KEYS: &str = "r throw the last one away, take it again   s skip this one   q stop";

/// Lines for a terminal of this many columns and rows.
pub fn render(guide: &Guide, status: &Status, columns: usize, rows: usize) -> Vec<Line> {
    let Advice { word, sentence } = match (&status.flash, status.silent_s) {
        (Some(view), _) => Advice::new("TAKEN", format!("{view} is on the disk")),
        (None, Some(s)) => {
            let look = "look at the cable, the power, the other program";
            Advice::new("NO FRAMES", format!("none for {s} s: {look}"))
        }
        (None, None) => Advice::of(guide),
    };
    let plain = |text: String| Line { text, style: Style::Plain };
    let mut lines =
        vec![plain(format!("{} views taken   {}", guide.wanted().progress(), status.title))];
    lines.extend(big(&word, columns).into_iter().map(|text| Line { text, style: Style::Loud }));
    lines.push(plain(sentence));
    lines.extend(big(&pose(guide), columns).into_iter().map(plain));
    lines.push(plain(stillness(guide)));
    lines.extend(map(guide).into_iter().map(plain));
    lines.push(plain(status.news.clone()));
    lines.truncate(rows.saturating_sub(1));
    lines.push(plain(KEYS.into()));
    for line in &mut lines {
        // Strings of a file may hold sequences that steer the terminal.
        line.text = line.text.chars().filter(|c| !c.is_control()).take(columns).collect();
        if status.flash.is_some() {
            line.style = Style::Flash;
        }
    }
    lines
}

/// Dots per letter, across and down.
const DOTS: usize = 8;

/// Text in big letters, with two vertical dots per character; unchanged if it is wider than `columns`.
/// Characters missing from the font are omitted.
fn big(text: &str, columns: usize) -> Vec<String> {
    let letter = |c| BASIC_FONTS.get(c).or_else(|| LATIN_FONTS.get(c));
    let letters: Vec<[u8; DOTS]> = text.chars().filter_map(letter).collect();
    if DOTS * letters.len() > columns {
        return vec![text.into()];
    }
    let block = |upper: u8, lower: u8, dot: usize| match (upper >> dot & 1, lower >> dot & 1) {
        (0, 0) => ' ',
        (1, 0) => '▀',
        (0, _) => '▄',
        _ => '█',
    };
    let row = |rows: usize| -> String {
        let of = |l: &[u8; DOTS]| (0..DOTS).map(|dot| block(l[rows], l[rows + 1], dot)).collect();
        letters.iter().map(of).collect::<Vec<String>>().concat()
    };
    (0..DOTS).step_by(2).map(row).collect()
}

fn pose(guide: &Guide) -> String {
    guide
        .pose()
        .map_or("-".into(), |pose| format!("{:.2}M {:.0}°", pose.z_m, pose.theta_rad.to_degrees()))
}

/// Stillness and warm-up drift.
fn stillness(guide: &Guide) -> String {
    let Some(moved) = guide.moved_m() else { return "no board".into() };
    let hold = guide.shutter().hold.max(1);
    let full = BAR * guide.held().min(hold) / hold;
    let bar = "█".repeat(full) + &"░".repeat(BAR - full);
    let drift = guide.drift().map_or(String::new(), |d| {
        let state = if d.is_warming() { "warming up" } else { "steady" };
        format!("   drift {:+.2} mm/min, {state}", 1e3 * d.per_minute_m)
    });
    format!("still {bar} {:.1} mm{drift}", 1e3 * moved)
}

fn map(guide: &Guide) -> Vec<String> {
    let wanted = guide.wanted();
    let grid = !wanted.any && wanted.views.iter().all(|v| v.tolerance.azimuth_rad.is_none());
    let draw = if grid { table } else { list };
    draw(wanted, guide.suggestion())
}

fn mark(view: &WantedView, next: Option<&WantedView>) -> char {
    match view.state {
        ViewState::Taken => '■',
        ViewState::Skipped => '-',
        ViewState::Open if next.is_some_and(|n| n.name == view.name) => '◎',
        ViewState::Open => '·',
    }
}

/// Distances down, tilts across.
fn table(wanted: &Wanted, next: Option<&WantedView>) -> Vec<String> {
    let distinct = |of: fn(&WantedView) -> f64| {
        let mut values: Vec<f64> = wanted.views.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        values
    };
    let tilts = distinct(|v| v.pose.theta_rad);
    let head: String =
        tilts.iter().map(|t| format!("{:>CELL$}", format!("{:.0}°", t.to_degrees()))).collect();
    let line = |z: f64| {
        let cell = |t: &f64| {
            let view = wanted.views.iter().find(|v| v.pose.z_m == z && v.pose.theta_rad == *t);
            format!("{:>CELL$}", view.map_or(' ', |v| mark(v, next)))
        };
        let cells: String = tilts.iter().map(cell).collect();
        format!("{:>8}{cells}", format!("{z:.2} m"))
    };
    let lines = distinct(|v| v.pose.z_m).into_iter().map(line);
    std::iter::once(format!("{:8}{head}", "")).chain(lines).collect()
}

/// Longest list: as many lines as the paper's grid has.
const MAX_LISTED: usize = 8;

/// Open views first, in list order; then the others, latest first.
fn list(wanted: &Wanted, next: Option<&WantedView>) -> Vec<String> {
    let line = |v: &WantedView| {
        let side = if v.is_directed() { far_side(v.pose.azimuth_rad) } else { "" };
        let far = if side.is_empty() { String::new() } else { format!("far {side}") };
        format!(
            "{:>4} {:.2} m  {:>3.0}°  {far:15}  {}",
            mark(v, next),
            v.pose.z_m,
            v.pose.theta_rad.to_degrees(),
            v.why.as_deref().unwrap_or_default()
        )
    };
    let open = wanted.views.iter().filter(|v| v.is_open());
    let rest = wanted.views.iter().rev().filter(|v| !v.is_open());
    open.chain(rest).take(MAX_LISTED).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_that_are_too_wide_for_big_letters_stay_as_they_are() {
        assert_eq!(big("BACK 20", 40), ["BACK 20"]);
        let rows = big("BACK 20°", 80);
        assert_eq!(rows.len(), DOTS / 2);
        assert!(rows.iter().all(|row| row.chars().count() == 8 * DOTS), "{rows:#?}");
    }
}
