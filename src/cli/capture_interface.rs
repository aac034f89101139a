//! The user interface of a capture: a log of lines, or a screen with keys.

use std::io::{IsTerminal, Write, stderr, stdin};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossterm::event::{self, KeyCode, KeyEvent, KeyModifiers};
use crossterm::style::{Attribute, Color, Print, SetAttribute, SetForegroundColor};
use crossterm::{cursor, execute, queue, terminal};
use kinoise::capture::{Command, Event, Guide, Interface, Line, Status, Style, render};

use super::console::say;

/// A flag set by SIGINT (Ctrl-C), SIGTERM or SIGHUP.
pub fn stop_signal() -> std::io::Result<Arc<AtomicBool>> {
    use signal_hook::{consts, flag::register};
    let stop = Arc::new(AtomicBool::new(false));
    register(consts::SIGINT, stop.clone())?;
    register(consts::SIGTERM, stop.clone())?;
    #[cfg(unix)]
    register(consts::SIGHUP, stop.clone())?;
    Ok(stop)
}

/// Whether both stdin and stderr are terminals.
pub fn is_interactive() -> bool {
    stdin().is_terminal() && stderr().is_terminal()
}

/// One line about the event; `None` if it is not worth a line.
fn message(event: &Event) -> Option<String> {
    match event {
        Event::Begun(_) | Event::Keep | Event::Done => None,
        Event::Finished(view) => Some(format!("{view} taken")),
        Event::Abandoned { view, why } => Some(format!("{view} thrown away: {why}")),
        Event::Rejected(view) => Some(format!("{view} thrown away, to be taken again")),
        Event::Drift(d) => {
            let state = if d.is_warming() { "the sensor is warming up" } else { "steady" };
            let (z, by, error) = (d.z_m, 1e3 * d.per_minute_m, 1e3 * d.std_error_m);
            let drifts = format!("drifts by {by:+.2} ± {error:.2} mm/min over {:.0} s", d.seconds);
            Some(format!("the plane at {z:.2} m {drifts}: {state}"))
        }
    }
}

/// Prints one line per event.
pub struct Log;

impl Interface for Log {
    fn event(&mut self, event: &Event, guide: &Guide) {
        let Some(line) = message(event) else { return };
        match (event, guide.pose()) {
            (Event::Finished(_), Some(pose)) => say(format!(
                "{line} at {:.2} m, {:.1} degrees ({})",
                pose.z_m,
                pose.theta_rad.to_degrees(),
                guide.wanted().progress()
            )),
            _ => say(line),
        }
    }
}

/// A silence longer than this is shown.
const MAX_SILENCE: Duration = Duration::from_secs(2);
/// Shown until the first message.
const HINT: &str = "just switched on? leave the board standing for 20 s: the drift is measured";
/// How long a taken view is shown.
const FLASH: Duration = Duration::from_millis(700);
/// Minimum time between redraws: faster, terminals fall behind and people cannot read it.
const REDRAW: Duration = Duration::from_millis(60);
/// Columns and rows where a terminal does not report its size: the classic 80 x 24.
const USUAL: (u16, u16) = (80, 24);

/// The terminal's alternate screen with large letters and keys, until dropped.
pub struct Screen {
    stop: Arc<AtomicBool>,
    status: Status,
    taken_at: Option<Instant>,
    drawn_at: Option<Instant>,
    bell: bool,
}

impl Screen {
    pub fn open(title: String, stop: Arc<AtomicBool>) -> std::io::Result<Self> {
        terminal::enable_raw_mode()?;
        let status = Status { title, news: HINT.into(), ..Status::default() };
        let screen = Screen { stop, status, taken_at: None, drawn_at: None, bell: false };
        let clear = terminal::Clear(terminal::ClearType::All);
        execute!(stderr(), terminal::EnterAlternateScreen, cursor::Hide, clear)?;
        Ok(screen)
    }

    fn draw(&mut self, guide: &Guide) {
        if self.taken_at.is_some_and(|t| t.elapsed() > FLASH) {
            (self.taken_at, self.status.flash) = (None, None);
        }
        if self.drawn_at.is_some_and(|t| t.elapsed() < REDRAW) && !self.bell {
            return;
        }
        let size = terminal::size().ok().filter(|(columns, rows)| *columns > 0 && *rows > 0);
        let (columns, rows) = size.unwrap_or(USUAL);
        let lines = render(guide, &self.status, columns.into(), rows.into());
        // Losing the terminal is no reason to stop taking views.
        let _ = draw(&lines, self.bell);
        self.bell = false;
        self.drawn_at = Some(Instant::now());
    }
}

/// Draws the lines over the screen without clearing it first.
fn draw(lines: &[Line], bell: bool) -> std::io::Result<()> {
    let mut out = Vec::new();
    for (row, line) in (0..).zip(lines) {
        queue!(out, cursor::MoveTo(0, row), SetAttribute(Attribute::Reset))?;
        let style = match line.style {
            Style::Plain => None,
            Style::Loud => Some((Attribute::Bold, Color::Yellow)),
            Style::Flash => Some((Attribute::Reverse, Color::Green)),
        };
        if let Some((attribute, colour)) = style {
            queue!(out, SetAttribute(attribute), SetForegroundColor(colour))?;
        }
        // Clear the rest of the line in the same style: a flash fills the screen.
        queue!(out, Print(&line.text), terminal::Clear(terminal::ClearType::UntilNewLine))?;
    }
    let rest = terminal::Clear(terminal::ClearType::FromCursorDown);
    queue!(out, SetAttribute(Attribute::Reset), rest)?;
    if bell {
        queue!(out, Print('\x07'))?;
    }
    stderr().write_all(&out)
}

impl Drop for Screen {
    fn drop(&mut self) {
        let reset = SetAttribute(Attribute::Reset);
        let _ = execute!(stderr(), reset, cursor::Show, terminal::LeaveAlternateScreen);
        let _ = terminal::disable_raw_mode();
    }
}

impl Interface for Screen {
    fn event(&mut self, event: &Event, _: &Guide) {
        match event {
            Event::Finished(view) => {
                self.status.flash = Some(view.clone());
                self.taken_at = Some(Instant::now());
                self.bell = true;
            }
            Event::Rejected(_) => (self.taken_at, self.status.flash) = (None, None),
            _ => {}
        }
        if let Some(news) = message(event) {
            self.status.news = news;
        }
    }

    fn frame(&mut self, guide: &Guide) {
        self.status.silent_s = None;
        self.draw(guide);
    }

    fn waiting(&mut self, guide: &Guide, silence: Duration) {
        self.status.silent_s = (silence > MAX_SILENCE).then_some(silence.as_secs());
        self.draw(guide);
    }

    fn command(&mut self) -> Option<Command> {
        while event::poll(Duration::ZERO).unwrap_or(false) {
            let key = event::read().ok()?.as_key_press_event();
            let Some(KeyEvent { code: KeyCode::Char(letter), modifiers, .. }) = key else {
                continue;
            };
            let plain = modifiers.difference(KeyModifiers::SHIFT).is_empty();
            match letter.to_ascii_lowercase() {
                'c' if modifiers == KeyModifiers::CONTROL => {
                    self.stop.store(true, Ordering::Relaxed);
                }
                'r' if plain => return Some(Command::Again),
                's' if plain => return Some(Command::Skip),
                'q' if plain => return Some(Command::Quit),
                _ => {}
            }
        }
        None
    }
}
