use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use anyhow::bail;
use clap::{Args, ValueEnum};
use kinoise::capture::{
    Audience, Ending, FreenectOptions, FreenectSource, Growing, Guide, Outcome, Playback, Queued,
    Session, Shutter, Source, ViewState, Wanted, capture,
};
use kinoise::io::Assumed;
use serde_json::json;

use super::capture_audience::{Log, Screen};
use super::common::{Global, Input, say};
use super::terminal;

#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording: a new folder, or one to go on with
    recording: PathBuf,
    /// freenect (a Kinect v1), folder:DIR (another program fills it), or play:REC (as if live)
    #[arg(long, value_name = "SOURCE")]
    source: SourceArgument,
    #[command(flatten)]
    views: Views,
    /// Frames of a view
    #[arg(long, value_name = "N", default_value_t = 30)]
    frames: usize,
    /// Frames for which the target must be still before
    #[arg(long, value_name = "N", default_value_t = 10)]
    hold: usize,
    /// Seconds without a frame after which the stream is given up
    #[arg(long, value_name = "S", default_value_t = 10)]
    patience: u64,
    /// Lines of text, no screen and no keys, also on a terminal
    #[arg(long)]
    plain: bool,
    /// libfreenect's file [default: where the system keeps libraries]
    #[arg(long, value_name = "FILE", env = "KINOISE_FREENECT")]
    library: Option<PathBuf>,
    /// Which Kinect, when several are plugged in
    #[arg(long)]
    serial: Option<String>,
    /// Depth alone, also where the sensor has infrared beside it
    #[arg(long)]
    no_infrared: bool,
    #[command(flatten)]
    input: Input,
}

#[derive(Debug, Args)]
struct Views {
    /// Which views are wanted
    #[arg(long, value_enum, default_value_t = ViewsArgument::Paper)]
    views: ViewsArgument,
    /// Own distances in m, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "M,M,..")]
    distances: Vec<f64>,
    /// Own tilts in degrees, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "DEG,..")]
    tilts: Vec<f64>,
    /// The views that a diagnosis advised
    #[arg(long, value_name = "FILE", conflicts_with_all = ["views", "distances", "tilts"])]
    advise: Option<PathBuf>,
    /// Take this view again; the old one stays until the new one is whole; repeatable
    #[arg(long, value_name = "VIEW")]
    retake: Vec<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum ViewsArgument {
    /// 1 to 4 m by 0.5 m, 0 to 80 degrees by 10: 63 views
    Paper,
    /// 1 to 4 m by 1 m, 0, 30, 60 and 75 degrees: 16 views
    Quick,
    /// Every still pose that is not there yet
    Any,
}

#[derive(Debug, Clone)]
enum SourceArgument {
    Freenect,
    Folder(PathBuf),
    Play(PathBuf),
}

impl FromStr for SourceArgument {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "freenect" => Ok(SourceArgument::Freenect),
            Some(("folder", path)) if !path.is_empty() => Ok(SourceArgument::Folder(path.into())),
            Some(("play", path)) if !path.is_empty() => Ok(SourceArgument::Play(path.into())),
            _ => Err("give freenect, folder:DIR or play:REC".into()),
        }
    }
}

impl Views {
    fn wanted(&self) -> anyhow::Result<Wanted> {
        if let Some(path) = &self.advise {
            return Ok(Wanted::advised(path)?);
        }
        if self.views == ViewsArgument::Any {
            if !self.distances.is_empty() || !self.tilts.is_empty() {
                bail!("--views any: it knows no grid; leave --distances and --tilts out");
            }
            return Ok(Wanted::any());
        }
        let (mut distances, mut tilts): (Vec<f64>, Vec<f64>) = match self.views {
            ViewsArgument::Quick => (vec![1.0, 2.0, 3.0, 4.0], vec![0.0, 30.0, 60.0, 75.0]),
            _ => (
                (0..7).map(|i| 1.0 + 0.5 * f64::from(i)).collect(),
                (0..9).map(|i| f64::from(10 * i)).collect(),
            ),
        };
        if !self.distances.is_empty() {
            distances.clone_from(&self.distances);
        }
        if !self.tilts.is_empty() {
            tilts.clone_from(&self.tilts);
        }
        if distances.iter().any(|z| !(0.1..=9.99).contains(z)) {
            bail!("--distances: a distance lies between 0.1 and 9.99 m");
        }
        if tilts.iter().any(|t| !(0.0..=88.0).contains(t)) {
            bail!("--tilts: a tilt lies between 0 and 88 degrees");
        }
        let tilts: Vec<f64> = tilts.iter().map(|t| t.to_radians()).collect();
        Ok(Wanted::grid(&distances, &tilts))
    }
}

/// An hour at 30 Hz.
const MOST_FRAMES: usize = 108_000;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<u8> {
    for (name, n) in [("--frames", arguments.frames), ("--hold", arguments.hold)] {
        if !(1..=MOST_FRAMES).contains(&n) {
            bail!("{name} {n}: give a number from 1 to {MOST_FRAMES}");
        }
    }
    let mut wanted = arguments.views.wanted()?;
    terminal::heed_signals();
    let screen = !arguments.plain && terminal::is_interactive();
    let mut source = source(arguments, screen)?;
    let mut session = Session::open(&arguments.recording, source.sensor())?;
    for remark in source.remarks().iter().chain(session.remarks()) {
        say(format!("note: {remark}"));
    }
    wanted.mark_taken(&session.taken()?);
    for view in &arguments.views.retake {
        wanted.take_again(view, &session.taken()?)?;
    }
    let shutter = Shutter { frames: arguments.frames, hold: arguments.hold };
    let mut guide = Guide::new(wanted, shutter);
    let mut audience: Box<dyn Audience> = match title(arguments, source.as_ref()) {
        title if screen => Box::new(Screen::new(title)),
        _ => Box::new(Log::default()),
    };
    let patience = Duration::from_secs(arguments.patience.max(1));
    let done = if guide.wanted().is_done() {
        Outcome { ending: Ending::Complete, finished: Vec::new(), frames: 0 }
    } else {
        capture(source.as_mut(), &mut session, &mut guide, audience.as_mut(), patience)
    };
    drop(audience);
    if source.dropped() > 0 {
        say(format!("note: {} frames came too fast and were lost", source.dropped()));
    }
    let kept = session.taken()?;
    report(global, arguments, &guide, &done, &kept, source.as_ref())?;
    finish(done.ending, &guide, &arguments.recording, kept.len())
}

fn source(arguments: &Arguments, paced: bool) -> anyhow::Result<Box<dyn Source>> {
    let assumed: Assumed = arguments.input.assumed()?;
    let only_freenect =
        [(arguments.serial.is_some(), "--serial"), (arguments.no_infrared, "--no-infrared")];
    if !matches!(arguments.source, SourceArgument::Freenect)
        && let Some((_, name)) = only_freenect.iter().find(|(given, _)| *given)
    {
        bail!("{name} belongs to --source freenect");
    }
    Ok(match &arguments.source {
        SourceArgument::Freenect => {
            let options = FreenectOptions {
                library: arguments.library.clone(),
                serial: arguments.serial.clone(),
                infrared: !arguments.no_infrared,
                assumed,
            };
            Box::new(Queued::start(move || FreenectSource::open(&options))?)
        }
        SourceArgument::Folder(path) => {
            let patience = Duration::from_secs(arguments.patience.max(1));
            Box::new(Growing::open(path, &assumed, patience)?)
        }
        SourceArgument::Play(path) => Box::new(Playback::open(path, &assumed, paced)?),
    })
}

fn title(arguments: &Arguments, source: &dyn Source) -> String {
    let sensor = source.sensor();
    let serial = sensor.serial.as_ref().map_or(String::new(), |s| format!(" {s}"));
    format!("{}   {}{serial}", arguments.recording.display(), sensor.name)
}

/// The result for programs.
fn report(
    global: &Global,
    arguments: &Arguments,
    guide: &Guide,
    done: &Outcome,
    kept: &[String],
    source: &dyn Source,
) -> anyhow::Result<()> {
    let wanted = guide.wanted();
    let open: Vec<&str> = wanted
        .views
        .iter()
        .filter(|v| v.state != ViewState::Taken)
        .map(|v| v.name.as_str())
        .collect();
    let ending = match &done.ending {
        Ending::Complete => "complete",
        Ending::Quit => "quit",
        Ending::Interrupted => "interrupted",
        Ending::Ended { .. } => "ended",
        Ending::Stalled(_) => "stalled",
        Ending::Failed(_) => "failed",
    };
    global.print_json(&json!({
        "recording": arguments.recording,
        "serial": source.sensor().serial,
        "ending": ending,
        "finished": done.finished,
        "views": kept,
        "still_wanted": open,
        "frames_seen": done.frames,
        "frames_lost": source.dropped(),
    }))
}

/// The last words and the exit code.
fn finish(ending: Ending, guide: &Guide, root: &Path, kept: usize) -> anyhow::Result<u8> {
    let wanted = guide.wanted();
    let missing = wanted.views.len() - wanted.count(ViewState::Taken);
    let stands = format!(
        "{kept} {} kept in {}",
        if kept == 1 { "view is" } else { "views are" },
        root.display()
    );
    let on = format!("{stands}, {missing} still wanted; the same command goes on");
    match ending {
        Ending::Complete => {
            let skipped = wanted.count(ViewState::Skipped);
            let but = if skipped > 0 { format!(", {skipped} skipped") } else { String::new() };
            say(format!("done: {stands}{but}"));
            Ok(0)
        }
        Ending::Quit => {
            say(format!("stopped: {on}"));
            Ok(0)
        }
        // Where anything will do, the end of a recording or of a folder's filling is the end.
        Ending::Ended { why, lost: false } if wanted.any && kept > 0 => {
            say(format!("done: {why}; {stands}"));
            Ok(0)
        }
        Ending::Stalled(after) if wanted.any && kept > 0 => {
            say(format!("done: no new frame for {} s; {stands}", after.as_secs()));
            Ok(0)
        }
        Ending::Interrupted => bail!("interrupted: {on}"),
        Ending::Ended { why, .. } => bail!("{why}: {on}"),
        Ending::Stalled(after) => bail!(
            "no frame for {} s: the stream stands still (look at the cable, the power supply, the \
             program that fills the folder): {on}",
            after.as_secs()
        ),
        Ending::Failed(e) => bail!("{e}: {on}"),
    }
}
