//! A Kinect v1 through libfreenect, which is loaded at run time and not needed to build. A thread of its own
//! serves the sensor while frames are processed.

mod dump;
mod factory;
#[allow(unsafe_code)] // the only C library
mod ffi;
mod unit;

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use super::source::{Arrival, End, Source};
use crate::error::{Error, Result};
use crate::io::Assumed;
use crate::view::Sensor;
use unit::Unit;

/// Queue capacity in frames: two seconds of a Kinect, 37 MB.
const CAPACITY: usize = 60;
/// How long the thread waits for a frame before it checks that the receiver still exists.
const POLL: Duration = Duration::from_millis(100);
/// A device that takes longer to close is left open until the process ends.
const MAX_CLOSING: Duration = Duration::from_secs(2);

/// User options for the sensor.
#[derive(Debug, Clone, Default)]
pub struct FreenectOptions {
    /// The library's file; by default searched where the system keeps libraries.
    pub library: Option<PathBuf>,
    /// Serial number of the unit, if several are connected.
    pub serial: Option<String>,
    /// Whether to record infrared too, if the sensor delivers it beside the depth.
    pub infrared: bool,
    /// Overrides of the values in the unit's memory.
    pub assumed: Assumed,
    /// Dump to play if the library is fakenect, which reads the path from FAKENECT_PATH itself.
    pub dump: Option<PathBuf>,
}

/// A running Kinect. Frames that do not fit into the queue are lost and counted; those of a dump
/// wait.
pub struct FreenectSource {
    sensor: Sensor,
    remarks: Vec<String>,
    live: bool,
    /// Set to `None` to end the thread.
    arrivals: Option<Receiver<Arrival>>,
    dropped: Arc<AtomicUsize>,
    /// Disconnected when the thread has closed the sensor.
    closed: Receiver<()>,
}

impl FreenectSource {
    /// Loads the library, finds the unit and starts its depth stream.
    /// Fails if the library is missing or is not libfreenect, no unit is connected, or it cannot be started.
    pub fn open(options: FreenectOptions) -> Result<Self> {
        let (to_queue, arrivals) = sync_channel(CAPACITY);
        let (to_opened, opened) = sync_channel(1);
        let (to_closed, closed) = sync_channel(0);
        let dropped = Arc::new(AtomicUsize::new(0));
        let count = dropped.clone();
        std::thread::spawn(move || {
            // Dropped last, when the sensor is closed.
            let _closed: SyncSender<()> = to_closed;
            match Unit::open(&options) {
                Ok(unit) => {
                    let about = (unit.sensor.clone(), unit.remarks.clone(), unit.live());
                    if to_opened.send(Ok(about)).is_ok() {
                        serve(unit, &to_queue, &count);
                    }
                }
                Err(e) => drop(to_opened.send(Err(e))),
            }
        });
        let lost = |_| Error::sensor("its thread ended before it began", "try again");
        let (sensor, remarks, live) = opened.recv().map_err(lost)??;
        Ok(FreenectSource { sensor, remarks, live, arrivals: Some(arrivals), dropped, closed })
    }
}

/// Forwards arrivals until the last one, or until the receiver is gone.
fn serve(mut unit: Unit, to: &SyncSender<Arrival>, dropped: &AtomicUsize) {
    loop {
        let arrival = unit.next(POLL);
        let (is_frame, is_last) =
            (matches!(arrival, Arrival::Frame(_)), matches!(arrival, Arrival::End(_)));
        let listened_to = if is_last || !unit.live() {
            to.send(arrival).is_ok()
        } else {
            let sent = to.try_send(arrival);
            if is_frame && matches!(sent, Err(TrySendError::Full(_))) {
                dropped.fetch_add(1, Ordering::Relaxed);
            }
            !matches!(sent, Err(TrySendError::Disconnected(_)))
        };
        if is_last || !listened_to {
            return;
        }
    }
}

impl Source for FreenectSource {
    fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    fn next(&mut self, wait: Duration) -> Arrival {
        match self.arrivals.as_ref().map(|queue| queue.recv_timeout(wait)) {
            Some(Ok(arrival)) => arrival,
            Some(Err(RecvTimeoutError::Timeout)) => Arrival::Nothing,
            _ => Arrival::End(End { why: "the sensor's thread has ended".into(), lost: true }),
        }
    }

    fn live(&self) -> bool {
        self.live
    }

    fn dropped(&self) -> usize {
        self.dropped.load(Ordering::Relaxed)
    }

    fn remarks(&self) -> &[String] {
        &self.remarks
    }
}

impl Drop for FreenectSource {
    fn drop(&mut self) {
        self.arrivals = None;
        let _ = self.closed.recv_timeout(MAX_CLOSING);
    }
}
