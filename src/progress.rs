//! Progress reports of long work.

/// Receives progress. A closure of (steps done, steps in all) receives the steps only.
pub trait Watch: Sync {
    /// Called when a stage begins, such as "measuring".
    fn stage(&self, _name: &'static str) {}

    fn step(&self, done: usize, all: usize);
}

impl<F: Fn(usize, usize) + Sync> Watch for F {
    fn step(&self, done: usize, all: usize) {
        self(done, all);
    }
}

/// A progress receiver as functions take it.
pub type Progress<'a> = &'a dyn Watch;
