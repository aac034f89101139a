//! A film to map: depth images in time order, with the colour image and the true pose that belong
//! to each, where there are any. Frames are read one at a time, when they are needed.
//!
//! Two layouts: that of the TUM RGB-D benchmark (depth.txt, rgb.txt, associations, groundtruth.txt)
//! and that of 7-Scenes (frame-XXXXXX.color/.depth/.pose).

mod moments;
mod scenes;
mod tum;

pub use moments::{Moment, Sequence};

use std::path::Path;

use crate::error::Result;
use crate::io::Assumed;
use moments::gaps;

/// Open a folder in one of the two layouts.
///
/// # Errors
/// When it is neither, a list in it cannot be read, or it holds no depth image.
pub fn open(root: &Path, assumed: &Assumed) -> Result<Sequence> {
    let mut sequence =
        if scenes::is_one(root) { scenes::open(root, assumed)? } else { tum::open(root, assumed)? };
    let colourless = sequence.moments.iter().filter(|m| m.colour.is_none()).count();
    if colourless > 0 {
        sequence.remarks.push(format!(
            "{colourless} of {} depth images have no colour image of their moment",
            sequence.moments.len()
        ));
    }
    sequence.remarks.extend(gaps(&sequence.moments));
    Ok(sequence)
}

#[cfg(test)]
mod tests;
