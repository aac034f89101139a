use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use anyhow::bail;
use clap::Args;
use kinoise::capture::{
    Audience, Ending, FreenectOptions, FreenectSource, Growing, Guide, Outcome, Playback, Queued,
    Session, Shutter, Source, ViewState, capture,
};
use kinoise::io::Assumed;
use serde_json::json;

use super::capture_audience::{Log, Screen};
use super::capture_views::Views;
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

/// An hour at 30 Hz.
const MAX_FRAMES: usize = 108_000;

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<u8> {
    for (name, n) in [("--frames", arguments.frames), ("--hold", arguments.hold)] {
        if !(1..=MAX_FRAMES).contains(&n) {
            bail!("{name} {n}: give a number from 1 to {MAX_FRAMES}");
        }
    }
    let mut wanted = arguments.views.wanted()?;
    into_itself(arguments)?;
    let screen = !arguments.plain && terminal::is_interactive();
    let mut source = source(arguments, screen)?;
    // Until here there is nothing to lose, and Ctrl-C ends the wait for a first image.
    terminal::heed_signals();
    let told = source.remarks().len();
    let mut session = Session::open(&arguments.recording, source.sensor())?;
    note(source.remarks());
    note(session.remarks());
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
    note(&source.remarks()[told..]);
    if source.dropped() > 0 {
        say(format!("note: {} frames came too fast and were lost", source.dropped()));
    }
    let kept = session.taken()?;
    report(global, arguments, &guide, &done, &kept, source.as_ref())?;
    finish(done.ending, &guide, &arguments.recording, kept.len())
}

/// Told one by one, up to so many.
const MAX_NOTES: usize = 12;

fn note(remarks: &[String]) {
    for remark in remarks.iter().take(MAX_NOTES) {
        say(format!("note: {remark}"));
    }
    if remarks.len() > MAX_NOTES {
        say(format!("note: and {} more like these", remarks.len() - MAX_NOTES));
    }
}

/// What is played or watched must not grow by what is taken from it.
fn into_itself(arguments: &Arguments) -> anyhow::Result<()> {
    let (SourceArgument::Folder(from) | SourceArgument::Play(from)) = &arguments.source else {
        return Ok(());
    };
    if let (Ok(from), Ok(to)) = (from.canonicalize(), arguments.recording.canonicalize())
        && from == to
    {
        bail!(
            "{}: this is the source; choose another folder for the recording",
            arguments.recording.display()
        );
    }
    Ok(())
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
    let still = if wanted.any { String::new() } else { format!(", {missing} still wanted") };
    let on = format!("{stands}{still}; the same command goes on");
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
