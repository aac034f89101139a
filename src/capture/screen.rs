//! The screen as text: big letters for the person with the board, a map of what is wanted.

use super::advice::{Step, side};
use super::font::big;
use super::guide::Guide;
use super::wanted::{ViewState, Wanted, WantedView};

/// How a line stands out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    Plain,
    /// What to do.
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

/// What the screen shows beside the guide's state.
#[derive(Debug, Clone, Default)]
pub struct Surroundings {
    /// The recording and its sensor.
    pub title: String,
    /// The view that was just taken.
    pub flash: Option<String>,
    /// The last thing told.
    pub news: String,
    /// Seconds without a frame, when it has been long.
    pub silent_s: Option<u64>,
}

/// Columns of the bar that fills while the target is still.
const BAR: usize = 20;
/// Columns of one cell of the map.
const CELL: usize = 5;

/// Lines for a terminal of this many columns and rows.
pub fn render(guide: &Guide, around: &Surroundings, columns: usize, rows: usize) -> Vec<Line> {
    let step = Step::of(guide);
    let (word, sentence) = match (&around.flash, around.silent_s) {
        (Some(view), _) => ("TAKEN".into(), format!("{view} is on the disk")),
        (None, Some(s)) => (
            "NO FRAMES".into(),
            format!("none for {s} s: look at the cable, the power, the other program"),
        ),
        (None, None) => (step.word(), step.sentence()),
    };
    let mut lines = vec![plain(title(guide, &around.title))];
    let loud = |text: &String| Line { text: text.clone(), style: Style::Loud };
    lines.extend(big(&word, columns).iter().map(loud));
    lines.push(plain(sentence));
    lines.extend(big(&pose(guide), columns).iter().cloned().map(plain));
    lines.push(plain(stillness(guide)));
    lines.extend(map(guide).into_iter().map(plain));
    lines.push(plain(around.news.clone()));
    let keys = plain("r throw the last one away, take it again   s skip this one   q stop".into());
    lines.truncate(rows.saturating_sub(1));
    lines.push(keys);
    for line in &mut lines {
        line.text = line.text.chars().take(columns).collect();
        if around.flash.is_some() {
            line.style = Style::Flash;
        }
    }
    lines
}

fn plain(text: String) -> Line {
    Line { text, style: Style::Plain }
}

fn title(guide: &Guide, title: &str) -> String {
    let wanted = guide.wanted();
    let taken = wanted.count(ViewState::Taken);
    let of = if wanted.any { String::new() } else { format!(" of {}", wanted.views.len()) };
    format!("{taken}{of} views taken   {title}")
}

fn pose(guide: &Guide) -> String {
    match guide.pose() {
        Some(pose) => format!("{:.2}M {:.0}°", pose.z_m, pose.theta_rad.to_degrees()),
        None => "-".into(),
    }
}

/// How still, and how warm.
fn stillness(guide: &Guide) -> String {
    let Some(moved) = guide.moved_m() else { return "no board".into() };
    let hold = guide.shutter().hold.max(1);
    let full = BAR * guide.held().min(hold) / hold;
    let bar: String = (0..BAR).map(|i| if i < full { '█' } else { '░' }).collect();
    let drift = guide.drift().map_or(String::new(), |d| {
        let word = if d.is_warming() { "warming up" } else { "steady" };
        format!("   drift {:+.2} mm/min, {word}", 1e3 * d.per_minute_m)
    });
    format!("still {bar} {:.1} mm{drift}", 1e3 * moved)
}

fn map(guide: &Guide) -> Vec<String> {
    let wanted = guide.wanted();
    let next = guide.suggestion().and_then(|i| wanted.views.get(i));
    let grid = !wanted.any && wanted.views.iter().all(|v| v.tolerance.azimuth_rad.is_none());
    if grid { table(wanted, next) } else { list(wanted, next) }
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
    let mut lines = vec![format!("{:8}{head}", "")];
    for z in distinct(|v| v.pose.z_m) {
        let cell = |t: &f64| {
            let view = wanted.views.iter().find(|v| v.pose.z_m == z && v.pose.theta_rad == *t);
            format!("{:>CELL$}", view.map_or(' ', |v| mark(v, next)))
        };
        let cells: String = tilts.iter().map(cell).collect();
        lines.push(format!("{:>8}{cells}", format!("{z:.2} m")));
    }
    lines
}

/// Lines of a list: as many as a grid of the paper has.
const LISTED: usize = 8;

/// Open ones first, as they stand; then the last that were taken.
fn list(wanted: &Wanted, next: Option<&WantedView>) -> Vec<String> {
    let line = |v: &WantedView| {
        let far = if v.is_directed() {
            format!("far {}", side(v.pose.azimuth_rad))
        } else {
            String::new()
        };
        format!(
            "{:>4} {:.2} m  {:>3.0}°  {far:15}  {}",
            mark(v, next),
            v.pose.z_m,
            v.pose.theta_rad.to_degrees(),
            v.why.as_deref().unwrap_or_default()
        )
    };
    let is_open = |v: &&WantedView| v.state == ViewState::Open;
    let open = wanted.views.iter().filter(is_open);
    let rest = wanted.views.iter().rev().filter(|v| !is_open(v));
    open.chain(rest).take(LISTED).map(line).collect()
}
