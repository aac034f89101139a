//! A Kinect v1 through libfreenect, which is loaded at run time: nothing is needed to build.

mod dump;
mod factory;
mod ffi;

use std::ffi::CString;
use std::path::PathBuf;
use std::time::{Duration, Instant, UNIX_EPOCH};

use super::source::{Arrival, End, LiveFrame, Source};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::io::Assumed;
use crate::view::Sensor;
use dump::Dump;
use ffi::{Device, Freenect, HEIGHT, INFRARED_HEIGHT, Loaded, WIDTH};

/// Names under which systems keep the library, most exact first.
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

/// What the user asks of the sensor.
#[derive(Debug, Clone, Default)]
pub struct FreenectOptions {
    /// The library's file; by default looked for where the system keeps libraries.
    pub library: Option<PathBuf>,
    /// Which unit, when several are plugged in.
    pub serial: Option<String>,
    /// Record infrared too, where the sensor gives it beside the depth.
    pub infrared: bool,
    /// In place of what the unit's memory says.
    pub assumed: Assumed,
    /// What the library plays if it is fakenect, which reads the path from FAKENECT_PATH itself.
    pub dump: Option<PathBuf>,
}

/// A running Kinect.
pub struct FreenectSource {
    device: Device,
    sensor: Sensor,
    infrared: bool,
    /// What fakenect plays, the stand-in for libfreenect.
    dump: Option<Dump>,
    remarks: Vec<String>,
}

impl FreenectSource {
    /// Load the library, find the unit, start its depth.
    ///
    /// # Errors
    /// When the library is missing or something else, no unit is there, or it cannot be started.
    pub fn open(options: &FreenectOptions) -> Result<Self> {
        let (library, dump) = load(options)?;
        let serial = unit(&library, options.serial.as_deref())?;
        let wanted = serial.as_deref().and_then(|s| CString::new(s).ok());
        let device = library.open(wanted.as_deref()).map_err(|code| {
            Error::sensor(
                format!("the Kinect cannot be opened (code {code}{})", complained()),
                "see that no other program uses it and that you may use USB devices (on Debian: \
                 the package libfreenect0.5 brings the udev rules; plug the Kinect in again)",
            )
        })?;
        let (sensor, mut remarks) = factory::sensor(serial, device.zero_plane(), &options.assumed);
        if let Some(fault) = sensor.fault() {
            return Err(Error::Argument {
                what: fault,
                remedy: "correct --intrinsics or --raw-disparity",
            });
        }
        device.start_depth().map_err(|what| Error::sensor(what + &complained(), PLUG_IN))?;
        // The stand-in aborts when it is asked for a mode it has not.
        let infrared = options.infrared && dump.is_none() && device.start_infrared();
        if options.infrared && !infrared {
            remarks.push("no infrared beside the depth; depth alone is recorded".into());
        }
        Ok(FreenectSource { device, sensor, infrared, dump, remarks })
    }

    fn frame(&self) -> Option<LiveFrame> {
        let (arrived, bytes) = ffi::depth()?;
        let infrared = if self.infrared { ffi::infrared() } else { None };
        Some(LiveFrame {
            stamp: arrived.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64(),
            depth: picture(&bytes),
            infrared: infrared.map(|bytes| picture(middle_rows(&bytes))),
        })
    }
}

impl Source for FreenectSource {
    fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    fn next(&mut self, wait: Duration) -> Result<Arrival> {
        let begun = Instant::now();
        loop {
            if let Some(frame) = self.frame() {
                return Ok(Arrival::Frame(frame));
            }
            if let Some(Err(why)) = self.dump.as_mut().map(Dump::advance) {
                return Ok(Arrival::End(End { why, lost: true }));
            }
            if self.device.process_events() < 0 {
                let gone = "the Kinect is gone (unplugged, or without power)";
                let why = format!("{gone}{}", complained());
                return Ok(Arrival::End(End { why, lost: true }));
            }
            if begun.elapsed() >= wait && self.dump.is_none() {
                return Ok(self.frame().map_or(Arrival::Nothing, Arrival::Frame));
            }
        }
    }

    /// A dump waits; a sensor does not.
    fn live(&self) -> bool {
        self.dump.is_none()
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }
}

/// The library, and the dump that it plays if it is the stand-in.
fn load(options: &FreenectOptions) -> Result<(Freenect, Option<Dump>)> {
    let candidates = match &options.library {
        Some(path) => vec![path.clone()],
        None => NAMES.map(PathBuf::from).into(),
    };
    let mut first = None;
    for path in &candidates {
        let loaded = Loaded::open(path);
        let dump = match &loaded {
            Ok(library) if library.is_stand_in() => Some(dump_to_play(options)?),
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

fn dump_to_play(options: &FreenectOptions) -> Result<Dump> {
    let missing = || {
        let what =
            "this libfreenect is the stand-in, and FAKENECT_PATH does not say what it is to play";
        Error::sensor(what, "set FAKENECT_PATH to a folder made by fakenect-record")
    };
    Dump::open(options.dump.as_ref().ok_or_else(missing)?)
}

/// Which unit to open: its serial where the library knows it.
fn unit(library: &Freenect, wanted: Option<&str>) -> Result<Option<String>> {
    if library.devices() < 1 {
        return Err(Error::sensor("no Kinect is connected (0 devices)", PLUG_IN));
    }
    let serials = library.serials();
    match (wanted, &serials) {
        (Some(wanted), Some(known)) if !known.iter().any(|s| s == wanted) => Err(Error::sensor(
            format!("no Kinect {wanted} is connected, but {}", known.join(", ")),
            "correct --serial",
        )),
        (Some(wanted), _) => Ok(Some(wanted.into())),
        // Later models have zeros for a serial.
        (None, known) => {
            Ok(known.iter().flatten().next().filter(|s| s.chars().any(|c| c != '0')).cloned())
        }
    }
}

fn complained() -> String {
    match ffi::complaint() {
        said if said.is_empty() => said,
        said => format!("; libfreenect says: {said}"),
    }
}

/// Little-endian 16-bit values, as the library unpacks them on every machine it is built for.
fn picture(bytes: &[u8]) -> Frame {
    let words = bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
    Frame { width: WIDTH, height: HEIGHT, raw: words }
}

/// The 480 rows in the middle of 488.
fn middle_rows(bytes: &[u8]) -> &[u8] {
    let first = 2 * WIDTH * (INFRARED_HEIGHT - HEIGHT) / 2;
    &bytes[first..first + 2 * WIDTH * HEIGHT]
}
