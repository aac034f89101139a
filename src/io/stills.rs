//! Cuts a film into views: stretches in which neither target nor sensor moves.

use std::path::{Path, PathBuf};

use super::images::read_depth;
use crate::camera::Camera;
use crate::frame::{DepthTable, Frame};
use crate::units::verb;
use crate::view::{FrameRef, Recording, Sensor, View, ViewNotes};

/// How the frames were taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Film {
    /// 30 Hz throughout, including while the target is carried: short stretches are motion.
    #[default]
    Video,
    /// Deliberate captures: a single frame is a view.
    Captures,
}

impl Film {
    /// Fewest frames in a view. A hand-held board is not still for a third of a second by accident.
    fn shortest(self) -> usize {
        match self {
            Film::Video => 10,
            Film::Captures => 1,
        }
    }
}

/// Spacing of the grid of pixels compared from frame to frame, px.
const GRID_PX: usize = 12;
/// A sample has moved if its depth changed by more than this share plus this coefficient (1/m) times z^2: at
/// least six standard deviations of a Kinect's noise (Khoshelham: 1.4e-3 z^2).
const MOVED_SHARE: f64 = 0.005;
const MOVED_QUADRATIC: f64 = 0.009;
/// The scene has moved if this share of the samples has.
const MOVED_SAMPLES: f64 = 0.10;
/// ... or if the samples measured in only one of the two frames reach this share of those in both: holes
/// flicker at edges and in shadows, but a board that is carried away leaves a hole where it was.
const MOVED_HOLES: f64 = 0.5;

/// Frames not yet divided into views, and what is known about them.
#[derive(Default)]
pub(super) struct Footage {
    pub frames: Vec<FrameRef>,
    pub film: Film,
    /// Oddities found while listing them.
    pub remarks: Vec<String>,
    pub described_by: Vec<PathBuf>,
    /// Timestamps, s, and temperatures, degrees Celsius, in time order.
    pub temperatures: Vec<(f64, f64)>,
}

impl Footage {
    /// Recording `cut` into views, or with all frames as one view, in motion or not.
    pub fn recording(self, root: &Path, sensor: Sensor, cut: bool) -> Recording {
        let captures = self.film == Film::Captures;
        let (mut views, mut remarks) = if cut {
            cut_up(self.frames, self.film, &sensor)
        } else {
            let name = root.file_name().unwrap_or_default().to_string_lossy().into_owned();
            (vec![view(name, self.frames)], Vec::new())
        };
        for view in &mut views {
            view.notes.temperature_c = temperature(&view.depth, &self.temperatures);
        }
        // Why frames are missing matters more than what was assumed about the others.
        remarks.extend(self.remarks);
        Recording {
            root: root.to_path_buf(),
            sensor,
            views,
            excluded: Vec::new(),
            remarks,
            captures,
            described_by: self.described_by,
        }
    }
}

/// Mean temperature while a view was filmed, or the reading nearest to its start.
fn temperature(frames: &[FrameRef], readings: &[(f64, f64)]) -> Option<f64> {
    let (first, last) = (frames.first()?.timestamp, frames.last()?.timestamp);
    let during: Vec<f64> =
        readings.iter().filter(|(t, _)| (first..=last).contains(t)).map(|(_, c)| *c).collect();
    if !during.is_empty() {
        return Some(during.iter().sum::<f64>() / during.len() as f64);
    }
    let apart = |(t, _): &(f64, f64)| (t - first).abs();
    readings.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).map(|(_, celsius)| *celsius)
}

fn view(name: String, depth: Vec<FrameRef>) -> View {
    View { name, depth, infrared: Vec::new(), notes: ViewNotes::default() }
}

/// Still stretches as views; frames in motion and frames without depth are left out, with a remark.
fn cut_up(frames: Vec<FrameRef>, film: Film, sensor: &Sensor) -> (Vec<View>, Vec<String>) {
    let listed = frames.len();
    let (stretches, blank) = stretches(frames, sensor);
    let readable: usize = stretches.iter().map(Vec::len).sum();
    let longest = stretches.iter().map(Vec::len).max().unwrap_or(0);
    let shortest = film.shortest().min(longest);
    let long = stretches.into_iter().filter(|stretch| stretch.len() >= shortest);
    let views: Vec<View> =
        long.enumerate().map(|(i, depth)| view(name(i, &depth, film), depth)).collect();
    let used: usize = views.iter().map(|v| v.depth.len()).sum();
    let mut remarks = Vec::new();
    if (1..film.shortest()).contains(&longest) && longest < readable {
        remarks.push(format!(
            "no stretch is still for {} frames, the longest for {longest}: target or sensor may be moving; hold still for a second at every pose",
            film.shortest()
        ));
    }
    if let Some((first, others)) = blank.split_first() {
        remarks.push(format!(
            "{} of {listed} frames cannot be read or carry no depth; the first: {first}",
            blank.len()
        ));
        remarks.extend(others.iter().map(|why| format!("frame left out: {why}")));
    }
    if used < readable {
        remarks.push(format!(
            "{} of {listed} frames {} between still stretches (target or sensor moving) and {} left out",
            readable - used,
            verb(readable - used, "lies", "lie"),
            verb(readable - used, "is", "are")
        ));
    }
    (views, remarks)
}

/// Runs of frames that agree with their first frame, and why each other frame was rejected.
fn stretches(frames: Vec<FrameRef>, sensor: &Sensor) -> (Vec<Vec<FrameRef>>, Vec<String>) {
    let table = sensor.code.table();
    let mut stretches: Vec<Vec<FrameRef>> = Vec::new();
    let mut reference = Vec::new();
    let mut blank = Vec::new();
    for frame in frames {
        match samples(&frame, &sensor.camera, &table) {
            Ok(samples) => match stretches.last_mut() {
                Some(stretch) if still(&reference, &samples) => stretch.push(frame),
                _ => {
                    reference = samples;
                    stretches.push(vec![frame]);
                }
            },
            Err(why) => blank.push(why),
        }
    }
    (stretches, blank)
}

/// Depths on the grid, or why the frame has none.
fn samples(frame: &FrameRef, camera: &Camera, table: &DepthTable) -> Result<Vec<f32>, String> {
    let image = read_depth(frame, camera.width, camera.height).map_err(|e| e.to_string())?;
    let samples = sample(&image, table);
    if samples.iter().all(|z| z.is_nan()) {
        return Err(format!("{}: no pixel carries a depth", frame.place()));
    }
    Ok(samples)
}

/// A single capture keeps its file's name; a stretch of a film gets a number.
fn name(index: usize, frames: &[FrameRef], film: Film) -> String {
    match (film, frames) {
        (Film::Captures, [only]) => match &only.within {
            Some(within) => format!("{:06}", within.index),
            None => only.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        },
        _ => format!("still-{index:03}"),
    }
}

fn sample(frame: &Frame, table: &DepthTable) -> Vec<f32> {
    (GRID_PX / 2..frame.height)
        .step_by(GRID_PX)
        .flat_map(|v| (GRID_PX / 2..frame.width).step_by(GRID_PX).map(move |u| v * frame.width + u))
        .map(|i| table.metres(frame.raw[i]))
        .collect()
}

fn still(reference: &[f32], samples: &[f32]) -> bool {
    let (mut seen, mut once, mut moved) = (0usize, 0usize, 0usize);
    for (&a, &b) in reference.iter().zip(samples) {
        let (a, b) = (f64::from(a), f64::from(b));
        if a.is_finite() && b.is_finite() {
            seen += 1;
            moved += usize::from((a - b).abs() > MOVED_SHARE * a + MOVED_QUADRATIC * a * a);
        } else {
            once += usize::from(a.is_finite() || b.is_finite());
        }
    }
    (moved as f64) < MOVED_SAMPLES * seen as f64 && (once as f64) < MOVED_HOLES * seen as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_still_and_a_shifted_board_is_not() {
        let reference: Vec<f32> = (0..1000).map(|i| 2.0 + (i % 7) as f32 * 1e-3).collect();
        let noisy: Vec<f32> =
            reference.iter().enumerate().map(|(i, z)| z + 0.006 * ((i % 3) as f32 - 1.0)).collect();
        assert!(still(&reference, &noisy));
        let moved: Vec<f32> =
            reference.iter().enumerate().map(|(i, z)| if i < 200 { z + 0.2 } else { *z }).collect();
        assert!(!still(&reference, &moved));
    }
}
