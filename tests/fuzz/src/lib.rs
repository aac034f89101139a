//! What the fuzz targets do with their bytes: one function a reader. Each asserts more than that nothing
//! panics: what is read and written again reads the same, and no number is NaN or infinite.
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

/// Says whether the bytes were read, not refused.
pub type Target = fn(&[u8]) -> bool;

/// Every target by its name, which is that of its corpus too.
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
