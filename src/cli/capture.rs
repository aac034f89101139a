use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{bail, ensure};
use clap::Args;
use kinoise::capture::{
    End, Ending, FreenectOptions, FreenectSource, Growing, Guide, Interface, Outcome,
    PAPER_DISTANCES_M, PAPER_TILTS_DEG, Playback, Session, Shutter, Source, ViewState, Wanted,
    capture,
};
use kinoise::io::refuse_inside;
use kinoise::units::{counted, verb};
use serde_json::json;

use super::capture_interface::{Log, Screen, is_interactive, stop_signal};
use super::common::{Global, Input, MAX_FRAMES, between, count, one_of};
use super::console::{beside, next_step, notes, result, say};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise capture my-kinect --source freenect --views quick
  kinoise capture my-kinect --source freenect --advise out/diagnosis/diagnosis.json")]
pub struct Arguments {
    /// The recording: a new folder, or one to continue
    recording: PathBuf,
    /// freenect (a Kinect v1), folder:DIR (another program fills it), or play:REC (as if live)
    #[arg(long, value_name = "SOURCE", value_parser = source_kind)]
    source: SourceKind,
    /// Frames to take of each view
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = count(1, MAX_FRAMES))]
    frames: usize,
    /// Frames for which the target must be still before a view begins
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = count(1, MAX_FRAMES))]
    hold: usize,
    /// Give the stream up after so many seconds without a frame
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = count(1, MAX_PATIENCE_S))]
    patience: usize,
    /// Print lines of text, without a screen and keys, on a terminal too
    #[arg(long)]
    plain: bool,
    /// libfreenect's file [default: where the system keeps libraries]
    #[arg(long, value_name = "FILE", env = "KINOISE_FREENECT")]
    library: Option<PathBuf>,
    /// The Kinect to use, when several are plugged in
    #[arg(long)]
    serial: Option<String>,
    /// Take depth alone, even where the sensor gives infrared beside it
    #[arg(long)]
    no_infrared: bool,
    #[command(flatten, next_help_heading = "Views")]
    views: Views,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

/// A day, s.
const MAX_PATIENCE_S: usize = 86_400;

/// Which views are to be taken.
#[derive(Debug, Args)]
struct Views {
    /// The views to take
    #[arg(long, default_value = "paper", value_parser = one_of([
        ("paper", "1 to 4 m by 0.5 m, 0 to 80 degrees by 10: 63 views", Some(PAPER)),
        ("quick", "1 to 4 m by 1 m, 0, 30, 60 and 75 degrees: 16 views", Some(QUICK)),
        ("any", "Every still pose that has not been taken yet", None),
    ]))]
    views: GridOrAny,
    /// Distances in m, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "M,M,..", value_parser = between(0.1, 9.99, "m"))]
    distances: Vec<f64>,
    /// Tilts in degrees, in place of the grid's
    #[arg(long, value_delimiter = ',', value_name = "DEG,..", value_parser = between(0.0, 88.0, "degrees"))]
    tilts: Vec<f64>,
    /// Take the views that this diagnosis.json advised
    #[arg(long, value_name = "FILE", conflicts_with_all = ["views", "distances", "tilts"])]
    advise: Option<PathBuf>,
    /// Take this view again; the old one stays until the new one is complete; repeatable
    #[arg(long, value_name = "VIEW")]
    retake: Vec<String>,
}

/// Distances in m, and tilts in degrees.
type Grid = (&'static [f64], &'static [f64]);
type GridOrAny = Option<Grid>;
const PAPER: Grid = (&PAPER_DISTANCES_M, &PAPER_TILTS_DEG);
const QUICK: Grid = (&[1.0, 2.0, 3.0, 4.0], &[0.0, 30.0, 60.0, 75.0]);

impl Views {
    fn wanted(&self) -> anyhow::Result<Wanted> {
        if let Some(path) = &self.advise {
            return Ok(Wanted::advised(path)?);
        }
        let own = |own: &[f64], grid: &[f64]| if own.is_empty() { grid } else { own }.to_vec();
        let Some((distances, tilts)) = self.views else {
            let none = self.distances.is_empty() && self.tilts.is_empty();
            ensure!(none, "--views any has no grid; leave --distances and --tilts out");
            return Ok(Wanted::any());
        };
        let (distances, tilts) = (own(&self.distances, distances), own(&self.tilts, tilts));
        let tilts: Vec<f64> = tilts.iter().map(|t| t.to_radians()).collect();
        Ok(Wanted::grid(&distances, &tilts))
    }
}

#[derive(Debug, Clone)]
enum SourceKind {
    Freenect,
    Folder(PathBuf),
    Play(PathBuf),
}

fn source_kind(text: &str) -> Result<SourceKind, String> {
    match text.split_once(':') {
        None if text == "freenect" => Ok(SourceKind::Freenect),
        Some(("folder", path)) if !path.is_empty() => Ok(SourceKind::Folder(path.into())),
        Some(("play", path)) if !path.is_empty() => Ok(SourceKind::Play(path.into())),
        _ => Err("give freenect, folder:DIR or play:REC".into()),
    }
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<u8> {
    let mut wanted = arguments.views.wanted()?;
    refuse_own_source(arguments)?;
    let screen = !arguments.plain && is_interactive();
    let mut source = source(arguments, screen)?;
    // Until here there is nothing to lose, and Ctrl-C ends the wait for a first image.
    let stop = stop_signal()?;
    let noted = source.remarks().len();
    let mut session = Session::open(&arguments.recording, source.sensor())?;
    notes(source.remarks());
    notes(session.remarks());
    let taken = session.taken()?;
    wanted.mark_taken(&taken);
    for view in &arguments.views.retake {
        wanted.take_again(view, &taken)?;
    }
    let shutter = Shutter { frames: arguments.frames, hold: arguments.hold };
    let mut guide = Guide::new(wanted, shutter);
    let done = if guide.wanted().is_done() {
        Outcome { ending: Ending::Complete, finished: Vec::new(), frames: 0 }
    } else {
        let mut interface: Box<dyn Interface> = if screen {
            Box::new(Screen::open(title(arguments, source.as_ref()), stop.clone())?)
        } else {
            Box::new(Log)
        };
        let patience = Duration::from_secs(arguments.patience as u64);
        capture(source.as_mut(), &mut session, &mut guide, interface.as_mut(), patience, &stop)
    };
    notes(&source.remarks()[noted..]);
    if source.dropped() > 0 {
        let (frames, were) =
            (counted(source.dropped(), "frame"), verb(source.dropped(), "was", "were"));
        say(format!("note: {frames} came too fast and {were} lost"));
    }
    let kept = session.taken()?;
    global.print_json(&json!({
        "recording": arguments.recording,
        "serial": source.sensor().serial,
        "ending": name_of(&done.ending),
        "finished": done.finished,
        "views": kept,
        "still_wanted": still_wanted(&guide),
        "frames_seen": done.frames,
        "frames_lost": source.dropped(),
    }))?;
    conclude(done.ending, &guide, &arguments.recording, kept.len())
}

/// Refuses to record into the folder being played or watched: it would grow by what is taken from it.
fn refuse_own_source(arguments: &Arguments) -> anyhow::Result<()> {
    let recording = &arguments.recording;
    let (SourceKind::Folder(from) | SourceKind::Play(from)) = &arguments.source else {
        return Ok(());
    };
    if let (Ok(from), Ok(to)) = (from.canonicalize(), recording.canonicalize())
        && from == to
    {
        let remedy = "choose another folder for the recording";
        bail!("{}: this is the source; {remedy}", recording.display());
    }
    if from.is_dir() {
        refuse_inside(recording, from)?;
    }
    Ok(())
}

fn source(arguments: &Arguments, paced: bool) -> anyhow::Result<Box<dyn Source>> {
    let assumed = arguments.input.assumed()?;
    let only_freenect =
        [(arguments.serial.is_some(), "--serial"), (arguments.no_infrared, "--no-infrared")];
    if !matches!(arguments.source, SourceKind::Freenect)
        && let Some((_, name)) = only_freenect.iter().find(|(given, _)| *given)
    {
        bail!("{name} belongs to --source freenect");
    }
    Ok(match &arguments.source {
        SourceKind::Freenect => {
            arguments.input.refuse_for_kinect()?;
            let options = FreenectOptions {
                library: arguments.library.clone(),
                serial: arguments.serial.clone(),
                infrared: !arguments.no_infrared,
                assumed,
                dump: std::env::var_os("FAKENECT_PATH").map(PathBuf::from),
            };
            Box::new(FreenectSource::open(options)?)
        }
        SourceKind::Folder(path) => {
            let patience = Duration::from_secs(arguments.patience as u64);
            Box::new(Growing::open(path, &assumed, patience)?)
        }
        SourceKind::Play(path) => Box::new(Playback::open(path, &assumed, paced)?),
    })
}

fn title(arguments: &Arguments, source: &dyn Source) -> String {
    let sensor = source.sensor();
    let serial = sensor.serial.as_ref().map_or(String::new(), |s| format!(" {s}"));
    format!("{}   {}{serial}", arguments.recording.display(), sensor.name)
}

fn still_wanted(guide: &Guide) -> Vec<&str> {
    let views = guide.wanted().views.iter().filter(|v| v.state != ViewState::Taken);
    views.map(|v| v.name.as_str()).collect()
}

fn name_of(ending: &Ending) -> &'static str {
    match ending {
        Ending::Complete => "complete",
        Ending::Quit => "quit",
        Ending::Interrupted => "interrupted",
        Ending::Ended(_) => "ended",
        Ending::Stalled(_) => "stalled",
        Ending::Failed(_) => "failed",
    }
}

/// The closing line and the exit code.
fn conclude(ending: Ending, guide: &Guide, root: &Path, kept: usize) -> anyhow::Result<u8> {
    let wanted = guide.wanted();
    let are = verb(kept, "is", "are");
    let stands = format!("{} {are} kept in {}", counted(kept, "view"), root.display());
    let missing = still_wanted(guide).len();
    let still = if wanted.any { String::new() } else { format!(", {missing} still wanted") };
    let on = format!("{stands}{still}; give the same command again to resume");
    let done = match ending {
        Ending::Complete => match wanted.count(ViewState::Skipped) {
            0 => format!("done: {stands}"),
            skipped => format!("done: {stands}, {skipped} skipped"),
        },
        Ending::Quit => format!("stopped: {on}"),
        // Without a list of views (--views any), the end of the recording or folder completes the capture.
        Ending::Ended(End { why, lost: false }) if wanted.any && kept > 0 => {
            format!("done: {why}; {stands}")
        }
        Ending::Stalled(after) if wanted.any && kept > 0 => {
            format!("done: no new frame for {} s; {stands}", after.as_secs())
        }
        Ending::Interrupted => bail!("interrupted: {on}"),
        Ending::Ended(End { why, .. }) => bail!("{why}: {on}"),
        Ending::Stalled(after) => bail!(
            "no frame for {} s: the stream has stopped (look at the cable, the power supply, the \
             program that fills the folder): {on}",
            after.as_secs()
        ),
        Ending::Failed(e) => bail!("{e}: {on}"),
    };
    result(done);
    if kept > 0 {
        let to = beside(root, "noise");
        next_step(&["calibrate".into(), root.into(), "-o".into(), to.into()]);
    }
    Ok(0)
}
