//! How long work tells what it is at.

/// Hears what goes on. A closure of (steps done, steps in all) hears the steps alone.
pub trait Watch: Sync {
    /// What begins now, as "measuring".
    fn stage(&self, _name: &'static str) {}

    fn step(&self, done: usize, all: usize);
}

impl<F: Fn(usize, usize) + Sync> Watch for F {
    fn step(&self, done: usize, all: usize) {
        self(done, all);
    }
}

/// Called as the work goes on.
pub type Progress<'a> = &'a dyn Watch;
