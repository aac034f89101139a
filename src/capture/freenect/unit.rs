//! One Kinect, used only on the thread that opened it, so that the library's handles need not move.

use std::ffi::CString;
use std::path::PathBuf;
use std::time::{Duration, Instant, UNIX_EPOCH};

use super::FreenectOptions;
use super::dump::Dump;
use super::factory;
use super::ffi::{Device, Freenect, HEIGHT, INFRARED_HEIGHT, Loaded, Mailbox, WIDTH, mailbox};
use crate::capture::source::{Arrival, End, LiveFrame};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::view::Sensor;

/// File names of the library on various systems, most specific first.
const NAMES: [&str; 6] = [
    "libfreenect.so.0.5",
    "libfreenect.so.0",
    "libfreenect.so",
    "libfreenect.dylib",
    "/opt/homebrew/lib/libfreenect.dylib",
    "/usr/local/lib/libfreenect.dylib",
];
const INSTALL: &str = "install it (Debian, Ubuntu: apt-get install libfreenect0.5; Fedora: dnf \
    install libfreenect; macOS: brew install libfreenect), or name the file with --library";
const PLUG_IN: &str =
    "plug the Kinect into USB and its own power supply, and see that no other program uses it";

pub struct Unit {
    device: Device,
    pub sensor: Sensor,
    infrared: bool,
    /// Dump played by fakenect, the stand-in for libfreenect.
    dump: Option<Dump>,
    pub remarks: Vec<String>,
}

impl Unit {
    /// Loads the library, finds the unit and starts its depth stream.
    /// Fails if the library is missing or is not libfreenect, no unit is connected, or it cannot be started.
    pub fn open(options: &FreenectOptions) -> Result<Self> {
        let (library, dump) = load(options)?;
        let serial = serial(&library, options.serial.as_deref())?;
        let wanted = serial.as_deref().and_then(|s| CString::new(s).ok());
        let device = library.open(wanted.as_deref()).map_err(|code| {
            Error::sensor(
                format!("the Kinect cannot be opened (code {code}{})", complaint()),
                "see that no other program uses it and that you may use USB devices (on Debian: \
                 the package libfreenect0.5 brings the udev rules; plug the Kinect in again)",
            )
        })?;
        let (sensor, mut remarks) = factory::sensor(serial, device.zero_plane(), &options.assumed);
        if let Some(what) = sensor.fault() {
            return Err(Error::Argument {
                what,
                remedy: "correct --intrinsics or --raw-disparity",
            });
        }
        let refused = |what| Error::sensor(format!("{what}{}", complaint()), PLUG_IN);
        device.start_depth().map_err(refused)?;
        // The stand-in aborts if it is asked for a mode that it lacks.
        let infrared = options.infrared && dump.is_none() && device.start_infrared();
        if options.infrared && !infrared {
            remarks.push("no infrared beside the depth; depth alone is recorded".into());
        }
        Ok(Unit { device, sensor, infrared, dump, remarks })
    }

    /// Whether frames arrive in real time; a dump waits.
    pub fn live(&self) -> bool {
        self.dump.is_none()
    }

    pub fn next(&mut self, wait: Duration) -> Arrival {
        let begun = Instant::now();
        loop {
            if let Some(frame) = mailbox(|mail| self.frame(mail)) {
                return Arrival::Frame(frame);
            }
            if let Some(Err(why)) = self.dump.as_mut().map(Dump::advance) {
                return Arrival::End(End { why, lost: true });
            }
            if self.device.process_events() < 0 {
                let why =
                    format!("the Kinect is gone (unplugged, or without power){}", complaint());
                return Arrival::End(End { why, lost: true });
            }
            if begun.elapsed() >= wait && self.live() {
                return mailbox(|mail| self.frame(mail)).map_or(Arrival::Nothing, Arrival::Frame);
            }
        }
    }

    fn frame(&self, mail: &mut Mailbox) -> Option<LiveFrame> {
        let (arrived, bytes) = mail.depth.pop_front()?;
        let infrared = mail.infrared.take().filter(|_| self.infrared);
        // The middle 480 of 488 rows.
        let above = 2 * WIDTH * (INFRARED_HEIGHT - HEIGHT) / 2;
        Some(LiveFrame {
            stamp: arrived.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64(),
            depth: picture(&bytes),
            infrared: infrared.map(|bytes| picture(&bytes[above..])),
        })
    }
}

/// Loads the library, and checks the dump that it plays if it is the stand-in.
fn load(options: &FreenectOptions) -> Result<(Freenect, Option<Dump>)> {
    let candidates = match &options.library {
        Some(path) => vec![path.clone()],
        None => NAMES.map(PathBuf::from).into(),
    };
    let mut first = None;
    for path in &candidates {
        let loaded = Loaded::load(path);
        let dump = match &loaded {
            Ok(library) if library.is_stand_in() => {
                let what = "this libfreenect is the stand-in, and FAKENECT_PATH does not say what it is to play";
                let remedy = "set FAKENECT_PATH to a folder made by fakenect-record";
                let root = options.dump.as_ref().ok_or_else(|| Error::sensor(what, remedy))?;
                Some(Dump::open(root)?)
            }
            _ => None,
        };
        match loaded.and_then(Loaded::start) {
            Ok(library) => return Ok((library, dump)),
            Err(why) => drop(first.get_or_insert(format!("{}: {why}", path.display()))),
        }
    }
    let why = first.unwrap_or_default();
    Err(Error::sensor(format!("libfreenect cannot be loaded ({why})"), INSTALL))
}

/// Serial number of the unit to open, if the library knows it.
fn serial(library: &Freenect, wanted: Option<&str>) -> Result<Option<String>> {
    if library.devices() < 1 {
        return Err(Error::sensor("no Kinect is connected (0 devices)", PLUG_IN));
    }
    let known = library.serials();
    match (wanted, &known) {
        (Some(wanted), Some(known)) if !known.iter().any(|s| s == wanted) => Err(Error::sensor(
            format!("no Kinect {wanted} is connected, but {}", known.join(", ")),
            "correct --serial",
        )),
        (Some(wanted), _) => Ok(Some(wanted.into())),
        // Later models have zeros as a serial number.
        (None, _) => Ok(known.into_iter().flatten().next().filter(|s| s.contains(|c| c != '0'))),
    }
}

fn complaint() -> String {
    match mailbox(|mail| std::mem::take(&mut mail.log)) {
        said if said.is_empty() => said,
        said => format!("; libfreenect says: {said}"),
    }
}

/// Little-endian 16-bit values, as the library unpacks them on every machine it is built for.
fn picture(bytes: &[u8]) -> Frame {
    let words = bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]));
    Frame { width: WIDTH, height: HEIGHT, raw: words.take(WIDTH * HEIGHT).collect() }
}
