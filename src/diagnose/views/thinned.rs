//! Subsamples large images to limit memory.
//!
//! Whole blocks are kept because neighbouring pixels are correlated. Distances from the target's edge stay
//! those of the full image.

use super::field::Field;

/// Largest image that is used whole, pixels; a Kinect has 0.3 megapixels, the largest time-of-flight
/// sensors one.
const MAX_PIXELS: usize = 1 << 20;
/// Side of a block, px: seven matching windows.
const BLOCK: usize = 64;

/// Stride of the blocks used along either axis, for images of this many pixels; 1 where all are used.
pub fn blocks_apart(pixels: usize) -> usize {
    (pixels.div_ceil(MAX_PIXELS) as f64).sqrt().ceil() as usize
}

/// Remark on the subsampling, if there is any.
pub fn remark(width: usize, height: usize) -> Option<String> {
    let apart = blocks_apart(width * height);
    (apart > 1).then(|| {
        let blocks = apart * apart;
        format!(
            "of images of {width} x {height} px one block of {BLOCK} x {BLOCK} px in {blocks} is looked at, to keep within memory"
        )
    })
}

impl Field {
    /// Drops the target's pixels outside the blocks used, before anything is measured; `expected` has one
    /// value per pixel. Drops none if no pixel would be left.
    pub(in crate::diagnose) fn subsample_blocks(&mut self, expected: &mut Vec<f32>) {
        let (width, height) = (self.width, self.height);
        let apart = blocks_apart(width * height);
        if apart < 2 {
            return;
        }
        let looked_at = |i: u32| {
            let (u, v) = (i as usize % width / BLOCK, i as usize / width / BLOCK);
            u % apart == 0 && v % apart == 0
        };
        let kept: Vec<bool> = self.pixels.iter().map(|&i| looked_at(i)).collect();
        if !kept.iter().any(|k| *k) {
            return;
        }
        keep(&mut self.pixels, &kept);
        keep(&mut self.sigma, &kept);
        keep(expected, &kept);
        keep(&mut self.edge, &kept);
        self.forget();
    }
}

fn keep<T>(values: &mut Vec<T>, kept: &[bool]) {
    let mut kept = kept.iter();
    values.retain(|_| kept.next().is_some_and(|k| *k));
    values.shrink_to_fit();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_images_are_looked_at_whole() {
        for (width, height, apart) in
            [(640, 480, 1), (1024, 1024, 1), (1280, 1024, 2), (2048, 1536, 2), (4096, 3072, 4)]
        {
            assert_eq!(blocks_apart(width * height), apart, "{width} x {height}");
            assert_eq!(remark(width, height).is_some(), apart > 1);
            // Partial blocks at the far side count too.
            let kept = |side: usize| side.div_ceil(BLOCK).div_ceil(apart) * BLOCK;
            assert!(kept(width) * kept(height) <= MAX_PIXELS + MAX_PIXELS / 4);
        }
    }
}
