//! Bodies of the fuzz targets, one function per reader. Each asserts more than the absence of panics: what
//! is read and written again reads the same, and no number is NaN or infinite.
//!
//! `tests/product/fuzz_corpus.rs` runs the kept corpora through the same functions, on stable Rust.

mod containers;
mod desk;
mod images;
mod lists;
mod numbers;
mod recording;

pub use containers::{db3, mcap, numpy, ros1};
pub use images::{depth_png, dump, picture};
pub use lists::{list, scenes, trajectory};
pub use numbers::{diagnosis, model, ply, table};
pub use recording::{recording, view};

/// Returns whether the bytes were read, not refused.
pub type Target = fn(&[u8]) -> bool;

/// Every target by its name, which is also that of its corpus.
pub const TARGETS: [(&str, Target); 16] = [
    ("recording", recording),
    ("view", view),
    ("list", list),
    ("depth_png", depth_png),
    ("picture", picture),
    ("dump", dump),
    ("model", model),
    ("diagnosis", diagnosis),
    ("table", table),
    ("trajectory", trajectory),
    ("scenes", scenes),
    ("ply", ply),
    ("ros1", ros1),
    ("mcap", mcap),
    ("db3", db3),
    ("numpy", numpy),
];
