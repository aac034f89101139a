//! Who looks on while views are taken: a log of lines, or a screen.

use std::time::{Duration, Instant};

use kinoise::capture::{Audience, Command, Event, Guide, Surroundings, ViewState, render};

use super::common::say;
use super::terminal::{self, Terminal};

/// What happened, in one line.
fn words(event: &Event) -> Option<String> {
    match event {
        Event::Begun(_) | Event::Keep | Event::Done => None,
        Event::Finished(view) => Some(format!("{view} taken")),
        Event::Abandoned { view, why } => Some(format!("{view} thrown away: {why}")),
        Event::Rejected(view) => Some(format!("{view} thrown away, to be taken again")),
        Event::Drift(d) => Some(format!(
            "the plane at {:.2} m drifts by {:+.2} ± {:.2} mm/min over {:.0} s: {}",
            d.z_m,
            1e3 * d.per_minute_m,
            1e3 * d.std_error_m,
            d.seconds,
            if d.is_warming() { "the sensor is warming up" } else { "steady" }
        )),
    }
}

/// One line an event.
#[derive(Default)]
pub struct Log {
    waiting: Vec<String>,
}

impl Audience for Log {
    fn event(&mut self, event: &Event) {
        self.waiting.extend(words(event));
    }

    fn frame(&mut self, guide: &Guide) {
        for line in self.waiting.drain(..) {
            let wanted = guide.wanted();
            let taken = wanted.count(ViewState::Taken);
            let of = if wanted.any { String::new() } else { format!(" of {}", wanted.views.len()) };
            let at = guide.pose().map_or(String::new(), |p| {
                format!(" at {:.2} m, {:.1} degrees", p.z_m, p.theta_rad.to_degrees())
            });
            if line.ends_with(" taken") {
                say(format!("{line}{at} ({taken}{of})"));
            } else {
                say(line);
            }
        }
    }

    fn waiting(&mut self, _: &Guide, _: Duration) {}

    fn command(&mut self) -> Option<Command> {
        None
    }

    fn interrupted(&self) -> bool {
        terminal::stopped()
    }
}

/// A silence longer than this is shown.
const SILENCE: Duration = Duration::from_secs(2);
/// Until there is news.
const HINT: &str = "just switched on? leave the board standing for 20 s: the drift is measured";
/// How long a taken view is shown.
const FLASH: Duration = Duration::from_millis(700);
/// Faster than this nobody reads, and terminals fall behind.
const REDRAW: Duration = Duration::from_millis(60);

/// Big letters, and keys.
pub struct Screen {
    terminal: Option<Terminal>,
    around: Surroundings,
    taken_at: Option<Instant>,
    drawn_at: Option<Instant>,
    bell: bool,
}

impl Screen {
    pub fn new(title: String) -> Self {
        Screen {
            terminal: Terminal::take(),
            around: Surroundings { title, news: HINT.into(), ..Surroundings::default() },
            taken_at: None,
            drawn_at: None,
            bell: false,
        }
    }

    fn draw(&mut self, guide: &Guide) {
        if self.taken_at.is_some_and(|t| t.elapsed() > FLASH) {
            (self.taken_at, self.around.flash) = (None, None);
        }
        let soon = self.drawn_at.is_some_and(|t| t.elapsed() < REDRAW);
        if let (Some(terminal), false) = (&self.terminal, soon && !self.bell) {
            let (columns, rows) = terminal.size();
            terminal.draw(&render(guide, &self.around, columns, rows), self.bell);
            self.bell = false;
            self.drawn_at = Some(Instant::now());
        }
    }
}

impl Audience for Screen {
    fn event(&mut self, event: &Event) {
        if let Event::Finished(view) = event {
            self.around.flash = Some(view.clone());
            self.taken_at = Some(Instant::now());
            self.bell = true;
        }
        if let Event::Rejected(_) = event {
            (self.taken_at, self.around.flash) = (None, None);
        }
        if let Some(news) = words(event) {
            self.around.news = news;
        }
    }

    fn frame(&mut self, guide: &Guide) {
        self.around.silent_s = None;
        self.draw(guide);
    }

    fn waiting(&mut self, guide: &Guide, silence: Duration) {
        self.around.silent_s = (silence > SILENCE).then_some(silence.as_secs());
        self.draw(guide);
    }

    fn command(&mut self) -> Option<Command> {
        match self.terminal.as_mut()?.key()? {
            'r' => Some(Command::Again),
            's' => Some(Command::Skip),
            'q' => Some(Command::Quit),
            _ => None,
        }
    }

    fn interrupted(&self) -> bool {
        terminal::stopped()
    }
}
