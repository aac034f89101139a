//! The column steps of two real Kinects, compared with the raw values to their left and right.

use std::path::Path;

use kinoise::measure::ColumnSteps;

use crate::common;

const WIDTH: usize = 640;
const NONE: u16 = 2047;

/// The raw images below a folder.
fn images(root: &Path) -> Vec<Vec<u16>> {
    let png = |path: &Path| path.extension().is_some_and(|e| e == "png");
    let files = common::tree(root).into_iter().filter(|(path, _)| png(path));
    let raw = |bytes: &[u8]| image::load_from_memory(bytes).expect("an image").into_luma16();
    files.map(|(_, bytes)| raw(&bytes).into_raw()).collect()
}

/// Mean rise of raw values from the previous column, over rows where both are valid and it is below three;
/// `None` with 100 such rows or fewer.
fn rise(raw: &[u16], column: usize) -> Option<f64> {
    let pairs = raw.chunks_exact(WIDTH).map(|row| [row[column - 1], row[column]]);
    let seen = pairs.filter(|pair| !pair.contains(&NONE));
    let rises: Vec<f64> = seen
        .map(|[before, after]| f64::from(after) - f64::from(before))
        .filter(|r| r.abs() < 3.0)
        .collect();
    (rises.len() > 100).then(|| rises.iter().sum::<f64>() / rises.len() as f64)
}

/// Number of images with steps; then, for step columns and for the columns beside them, how many rise by more
/// than half a raw value in the step's direction, and of how many.
fn seen(images: &[Vec<u16>]) -> (usize, [usize; 2], [usize; 2]) {
    let (mut shown, mut steps, mut beside) = (0, [0; 2], [0; 2]);
    for raw in images {
        let px = |&r: &u16| if r == NONE { f32::NAN } else { -f32::from(r) / 8.0 };
        let disparity: Vec<f32> = raw.iter().map(px).collect();
        let Some(found) = ColumnSteps::find(&disparity, WIDTH) else { continue };
        shown += 1;
        let jumps = |u: usize| found.error_px(u) - found.error_px(u - 1);
        for u in (2..WIDTH - 1).filter(|&u| jumps(u).abs() > 0.5 / 8.0) {
            let rises = |count: &mut [usize; 2], column: usize| {
                if let Some(rise) = rise(raw, column) {
                    let up = -jumps(u).signum() * rise > 0.5;
                    *count = [count[0] + usize::from(up), count[1] + 1];
                }
            };
            rises(&mut steps, u);
            rises(&mut beside, u - 1);
            rises(&mut beside, u + 1);
        }
    }
    (shown, steps, beside)
}

#[test]
fn each_image_of_a_real_kinect_shows_its_own() {
    // The second unit's disparities were converted to mm and back: not every step is a whole one.
    let units = [("herrera-kinect-v1/recording", 39, 0.97), ("kinect-v1-second-unit", 33, 0.9)];
    for (folder, of, share) in units {
        let Some(folder) = common::data(folder) else { continue };
        let images = images(&folder);
        assert_eq!(images.len(), of);
        let (shown, [right, steps], [wrong, beside]) = seen(&images);
        println!(
            "{shown} of {of} images: {right} of {steps} steps right, {wrong} of {beside} beside one"
        );
        assert_eq!(shown, of);
        assert!(right as f64 > share * steps as f64, "{right} of {steps}");
        // On a steep board every column rises.
        assert!(20 * wrong < beside, "{wrong} of {beside}");
    }
}
