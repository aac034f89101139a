//! A source on a thread of its own, so that a sensor is served while a frame is looked at.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::source::{Arrival, End, Source};
use crate::error::{Error, Result};
use crate::view::Sensor;

/// Two seconds of a Kinect, 37 MB.
const ROOM: usize = 60;
/// How long the thread waits for a frame before it looks whether it is still wanted.
const BREATH: Duration = Duration::from_millis(100);
/// A device that does not let go is left to the end of the process.
const FAREWELL: Duration = Duration::from_secs(2);

type Message = Result<Arrival>;

/// Any source, served by a thread. What does not fit in the queue is counted and lost when the
/// source is live, and waits otherwise.
pub struct Queued {
    sensor: Sensor,
    remarks: Vec<String>,
    live: bool,
    frames: Option<Receiver<Message>>,
    stop: Arc<AtomicBool>,
    dropped: Arc<AtomicUsize>,
    thread: Option<JoinHandle<()>>,
}

/// What the thread says first.
struct Opened {
    sensor: Sensor,
    remarks: Vec<String>,
    live: bool,
}

impl Queued {
    /// Open a source on a new thread: handles of C libraries need never change hands.
    ///
    /// # Errors
    /// Those of `open`.
    pub fn start<S: Source>(open: impl FnOnce() -> Result<S> + Send + 'static) -> Result<Self> {
        let (to_us, frames) = sync_channel(ROOM);
        let (opened_to_us, opened) = sync_channel(1);
        let stop = Arc::new(AtomicBool::new(false));
        let dropped = Arc::new(AtomicUsize::new(0));
        let shared = (stop.clone(), dropped.clone());
        let thread = std::thread::spawn(move || match open() {
            Ok(source) => {
                let first = Opened {
                    sensor: source.sensor().clone(),
                    remarks: source.remarks().to_vec(),
                    live: source.live(),
                };
                if opened_to_us.send(Ok(first)).is_ok() {
                    serve(source, &to_us, &shared.0, &shared.1);
                }
            }
            Err(e) => drop(opened_to_us.send(Err(e))),
        });
        let lost = |_| Error::sensor("its thread ended before it began", "try again");
        let Opened { sensor, remarks, live } = opened.recv().map_err(lost)??;
        Ok(Queued {
            sensor,
            remarks,
            live,
            frames: Some(frames),
            stop,
            dropped,
            thread: Some(thread),
        })
    }
}

fn serve<S: Source>(
    mut source: S,
    to: &SyncSender<Message>,
    stop: &AtomicBool,
    dropped: &AtomicUsize,
) {
    while !stop.load(Ordering::Relaxed) {
        let message = source.next(BREATH);
        let last = matches!(message, Err(_) | Ok(Arrival::End(_)));
        if matches!(message, Ok(Arrival::Nothing)) {
            continue;
        }
        if source.live() && !last {
            match to.try_send(message) {
                Ok(()) => {}
                Err(TrySendError::Full(_)) => drop(dropped.fetch_add(1, Ordering::Relaxed)),
                Err(TrySendError::Disconnected(_)) => return,
            }
        } else if to.send(message).is_err() || last {
            return;
        }
    }
}

impl Source for Queued {
    fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    fn next(&mut self, wait: Duration) -> Result<Arrival> {
        let gone = || End { why: "the sensor's thread has ended".into(), lost: true };
        let Some(frames) = &self.frames else { return Ok(Arrival::End(gone())) };
        match frames.recv_timeout(wait) {
            Ok(message) => message,
            Err(RecvTimeoutError::Timeout) => Ok(Arrival::Nothing),
            Err(RecvTimeoutError::Disconnected) => Ok(Arrival::End(gone())),
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

impl Drop for Queued {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A thread that waits for room in the queue learns so that there is nobody left.
        self.frames = None;
        let begun = Instant::now();
        if let Some(thread) = self.thread.take() {
            while !thread.is_finished() && begun.elapsed() < FAREWELL {
                std::thread::sleep(Duration::from_millis(5));
            }
            if thread.is_finished() {
                let _ = thread.join();
            }
        }
    }
}
