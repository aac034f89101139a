//! A source on a thread of its own, so that a sensor is served while a frame is looked at.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::Duration;

use super::source::{Arrival, End, Source};
use crate::error::{Error, Result};
use crate::view::Sensor;

/// Frames that may wait: two seconds of a Kinect, 37 MB.
const CAPACITY: usize = 60;
/// How long the thread waits for a frame before it looks whether anyone still listens.
const POLL: Duration = Duration::from_millis(100);
/// A device that takes longer to close is left to the end of the process.
const MAX_CLOSING: Duration = Duration::from_secs(2);

/// Any source, served by a thread. Frames that do not fit into the queue are lost and counted
/// when the source is live, and wait otherwise.
pub struct Threaded {
    sensor: Sensor,
    remarks: Vec<String>,
    live: bool,
    /// `None` once nobody listens any more, which ends the thread.
    arrivals: Option<Receiver<Result<Arrival>>>,
    dropped: Arc<AtomicUsize>,
    /// Disconnected when the thread has closed the source.
    closed: Receiver<()>,
}

impl Threaded {
    /// Open a source on a new thread, where it stays: handles of C libraries need not be moved.
    ///
    /// # Errors
    /// Those of `open`.
    pub fn start<S: Source>(open: impl FnOnce() -> Result<S> + Send + 'static) -> Result<Self> {
        let (to_queue, arrivals) = sync_channel(CAPACITY);
        let (to_opened, opened) = sync_channel(1);
        let (to_closed, closed) = sync_channel(0);
        let dropped = Arc::new(AtomicUsize::new(0));
        let count = dropped.clone();
        std::thread::spawn(move || {
            // Dropped last, when the source is closed.
            let _closed: SyncSender<()> = to_closed;
            match open() {
                Ok(source) => {
                    let about = (source.sensor().clone(), source.remarks().to_vec(), source.live());
                    if to_opened.send(Ok(about)).is_ok() {
                        serve(source, &to_queue, &count);
                    }
                }
                Err(e) => drop(to_opened.send(Err(e))),
            }
        });
        let lost = |_| Error::sensor("its thread ended before it began", "try again");
        let (sensor, remarks, live) = opened.recv().map_err(lost)??;
        Ok(Threaded { sensor, remarks, live, arrivals: Some(arrivals), dropped, closed })
    }
}

/// Pass arrivals on until the last, or until nobody listens.
fn serve(mut source: impl Source, to: &SyncSender<Result<Arrival>>, dropped: &AtomicUsize) {
    loop {
        let arrival = source.next(POLL);
        let is_frame = matches!(arrival, Ok(Arrival::Frame(_)));
        let is_last = matches!(arrival, Err(_) | Ok(Arrival::End(_)));
        let listened_to = if source.live() && !is_last {
            match to.try_send(arrival) {
                Err(TrySendError::Full(_)) if is_frame => {
                    dropped.fetch_add(1, Ordering::Relaxed);
                    true
                }
                sent => !matches!(sent, Err(TrySendError::Disconnected(_))),
            }
        } else {
            to.send(arrival).is_ok()
        };
        if is_last || !listened_to {
            return;
        }
    }
}

impl Source for Threaded {
    fn sensor(&self) -> &Sensor {
        &self.sensor
    }

    fn next(&mut self, wait: Duration) -> Result<Arrival> {
        let arrival = self.arrivals.as_ref().map(|queue| queue.recv_timeout(wait));
        match arrival {
            Some(Ok(arrival)) => arrival,
            Some(Err(RecvTimeoutError::Timeout)) => Ok(Arrival::Nothing),
            _ => {
                let why = "the sensor's thread has ended".into();
                Ok(Arrival::End(End { why, lost: true }))
            }
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

impl Drop for Threaded {
    fn drop(&mut self) {
        self.arrivals = None;
        let _ = self.closed.recv_timeout(MAX_CLOSING);
    }
}
