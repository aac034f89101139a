//! The product's tests, a module per subject, seconds each. Tests that simulate hundreds of recordings or
//! diagnose whole families of causes are in tests/slow.
//!
//! All random numbers are seeded, so the tests are deterministic; false-alarm probabilities say how often
//! correct code would fail under another seed.

#![forbid(unsafe_code)]

#[path = "../common/mod.rs"]
mod common;

mod against;
mod bad_input;
mod capture;
mod capture_kinect;
mod claims;
mod clocks;
mod column_steps;
mod command_line;
mod containers;
mod correct;
mod degenerate;
mod desk;
mod determinism;
mod distances;
mod effects;
mod export_files;
mod export_programs;
mod extended_map;
#[cfg(unix)] // bash sets the limits
mod faults;
mod fit;
mod flatness;
mod fuzz_corpus;
mod hostile;
mod invariances;
mod kept_aside;
mod layouts;
#[cfg(unix)] // pipes
mod limits;
mod lines;
mod map;
mod measure;
mod metrics;
mod model_file;
mod other_views;
mod outliers;
mod pages;
mod ranges;
mod room;
mod round_trips;
mod schema;
mod sensors;
mod sigma_images;
mod speckle;
mod target;
mod traps_input;
mod traps_output;
mod twin;
mod uncertainty;
mod units;
