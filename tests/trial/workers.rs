//! Sets worked on side by side.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use kinoise::error::{Error, Result};

/// What happens, how many are done, how many there are.
pub type Progress<'a> = &'a (dyn Fn(&'static str, usize, usize) + Sync);

/// `work` on every item, `workers` at a time, in order of the items. Nothing new is begun after a
/// failure; the first one is returned.
///
/// # Errors
/// What `work` says.
pub fn each<T: Sync, R: Send>(
    items: &[T],
    workers: usize,
    (what, progress): (&'static str, Progress<'_>),
    work: impl Fn(&T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let (next, done, failed) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicBool::new(false));
    let results: Mutex<Vec<(usize, Result<R>)>> = Mutex::new(Vec::with_capacity(items.len()));
    progress(what, 0, items.len());
    std::thread::scope(|scope| {
        for _ in 0..workers.clamp(1, items.len().max(1)) {
            scope.spawn(|| {
                while !failed.load(Ordering::Relaxed) {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(i) else { break };
                    let result = work(item);
                    failed.fetch_or(result.is_err(), Ordering::Relaxed);
                    if let Ok(mut results) = results.lock() {
                        results.push((i, result));
                    }
                    progress(what, done.fetch_add(1, Ordering::Relaxed) + 1, items.len());
                }
            });
        }
    });
    let mut results = results.into_inner().map_err(|_| Error::Solver {
        what: "a worker of the trial stopped".into(),
        remedy: "run it again; it goes on where it was",
    })?;
    results.sort_by_key(|r| r.0);
    results.into_iter().map(|r| r.1).collect()
}
