//! Result and timing of each frame, and remarks on all of them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::Instant;

use nalgebra::Isometry3;

use super::icp::Alignment;
use crate::evaluate::ClockOffset;
use crate::stats::median;
use crate::trajectory::Pose;
use crate::units::verb;

#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// The first frame; its camera frame is the map frame.
    First,
    Tracked,
    /// No pose, and why.
    Lost(String),
}

#[derive(Debug, Clone, PartialEq)]
pub struct FrameReport {
    pub stamp: f64,
    pub fate: Fate,
    /// Camera pose, `map_from_camera`; `None` when lost.
    pub pose: Option<Isometry3<f64>>,
    /// Pose from features of the colour images alone, at the colour image's own stamp.
    pub by_colour: Option<Pose>,
    /// Present for every frame that was aligned, whether the result was accepted or not.
    pub alignment: Option<Alignment>,
    /// Whether the depth image is bit-identical to that of the last frame with a pose.
    pub repeated: bool,
    /// A problem with its files.
    pub remark: Option<String>,
    pub stages: Stages,
}

impl FrameReport {
    /// A frame without a pose.
    pub fn lost(stamp: f64, why: String) -> Self {
        FrameReport {
            stamp,
            fate: Fate::Lost(why),
            pose: None,
            by_colour: None,
            alignment: None,
            repeated: false,
            remark: None,
            stages: Stages::default(),
        }
    }

    /// The alignment that gave the pose.
    fn tracked(&self) -> Option<&Alignment> {
        self.alignment.as_ref().filter(|_| self.fate == Fate::Tracked)
    }
}

/// Milliseconds by stage name, in order of first appearance.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stages(Vec<(&'static str, f64)>);

impl Stages {
    pub fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let done = work();
        let ms = begin.elapsed().as_secs_f64() * 1e3;
        match self.0.iter_mut().find(|(known, _)| *known == name) {
            // A stage may run twice for one frame.
            Some((_, sum)) => *sum += ms,
            None => self.0.push((name, ms)),
        }
        done
    }

    pub fn each(&self) -> impl Iterator<Item = (&'static str, f64)> + '_ {
        self.0.iter().copied()
    }

    pub fn total(&self) -> f64 {
        self.0.iter().map(|(_, ms)| ms).sum()
    }

    /// Median of each stage over frames.
    pub fn medians(all: &[Stages]) -> Stages {
        let mut lists: Vec<(&'static str, Vec<f64>)> = Vec::new();
        for (name, ms) in all.iter().flat_map(Stages::each) {
            match lists.iter_mut().find(|(known, _)| *known == name) {
                Some((_, list)) => list.push(ms),
                None => lists.push((name, vec![ms])),
            }
        }
        Stages(lists.into_iter().map(|(name, mut list)| (name, median(&mut list))).collect())
    }
}

/// A camera that never went farther than this did not move, m: a tenth of a Kinect's noise.
const STILL_M: f64 = 2e-4;

/// Remarks on oddities, in sentences.
pub fn remarks(frames: &[FrameReport]) -> Vec<String> {
    [lost(frames), degenerate(frames), repeated(frames), still(frames)]
        .into_iter()
        .flatten()
        .collect()
}

/// Remark on a film whose clocks disagree, so that depth and colour are not from the same moment.
pub fn clocks(offset: &ClockOffset) -> String {
    let [ms, error] = [offset.seconds.abs(), offset.std_error_s].map(|s| 1e3 * s);
    let way = if offset.seconds > 0.0 { "late" } else { "early" };
    format!(
        "the depth images are stamped {ms:.1} ± {error:.1} ms {way} beside the colour images, by how each sees the camera turn: \
         colour is taken from beside the surface that it belongs to"
    )
}

fn lost(frames: &[FrameReport]) -> Option<String> {
    let lost: Vec<(f64, &String)> = frames
        .iter()
        .filter_map(|f| match &f.fate {
            Fate::Lost(why) => Some((f.stamp, why)),
            _ => None,
        })
        .collect();
    let (first, why) = lost.first()?;
    let end = if frames.last().is_some_and(|f| f.pose.is_none()) {
        "; the last frames are among them: the trajectory ends early"
    } else {
        ""
    };
    Some(format!(
        "lost in {} of {} frames, first at {first:.6}: {why}{end}",
        lost.len(),
        frames.len()
    ))
}

fn degenerate(frames: &[FrameReport]) -> Option<String> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut any = 0;
    for alignment in frames.iter().filter_map(FrameReport::tracked) {
        any += usize::from(!alignment.degenerate_directions.is_empty());
        for direction in &alignment.degenerate_directions {
            *counts.entry(direction.to_string()).or_default() += 1;
        }
    }
    let mut listed: Vec<(String, usize)> = counts.into_iter().collect();
    listed.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let names: Vec<String> = listed.iter().map(|(name, n)| format!("{name} ({n})")).collect();
    (any > 0).then(|| {
        format!(
            "in {any} of {} frames depth does not determine the whole motion: {}; along these the start was kept",
            frames.len(),
            names.join(", ")
        )
    })
}

fn repeated(frames: &[FrameReport]) -> Option<String> {
    let n = frames.iter().filter(|f| f.repeated).count();
    (n > 0).then(|| {
        format!(
            "{n} of {} depth images {} the one before, bit by bit: a frozen driver?",
            frames.len(),
            verb(n, "is", "are")
        )
    })
}

fn still(frames: &[FrameReport]) -> Option<String> {
    let far =
        frames.iter().filter_map(|f| Some(f.pose?.translation.vector.norm())).fold(0.0, f64::max);
    (frames.len() > 1 && far < STILL_M).then(|| "the camera never moved".to_string())
}

/// The table frames.csv, one row per frame: fate, standard deviations of the pose (m and rad),
/// iterations, share of points with a neighbour, pairs, their rms, and what depth does not determine.
pub fn frames_csv(frames: &[FrameReport]) -> String {
    let mut text = String::from(
        "timestamp,fate,sigma_x_m,sigma_y_m,sigma_z_m,sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,iterations,matched,pairs,rms_m,weakest,undetermined\n",
    );
    for frame in frames {
        let (fate, unaligned_ratio) = match &frame.fate {
            Fate::First => ("first", 1.0),
            Fate::Tracked => ("tracked", 0.0),
            Fate::Lost(_) => ("lost", 0.0),
        };
        // Writing to a String does not fail.
        let _ = write!(text, "{:.6},{fate}", frame.stamp);
        for k in 0..6 {
            let sigma = frame.tracked().map(|a| a.covariance[(k, k)].max(0.0).sqrt());
            let _ = write!(text, ",{}", sigma.map(|s| format!("{s:.3e}")).unwrap_or_default());
        }
        let _ = match &frame.alignment {
            Some(a) => write!(
                text,
                ",{},{:.4},{},{},{:.5}",
                a.iterations,
                a.inlier_ratio,
                a.correspondences,
                a.rms_m.map(|m| format!("{m:.6}")).unwrap_or_default(),
                a.min_information
            ),
            None => write!(text, ",0,{unaligned_ratio:.4},0,0.000000,0.00000"),
        };
        let directions = frame.tracked().map(|a| a.degenerate_directions.as_slice());
        let names: Vec<String> =
            directions.unwrap_or_default().iter().map(ToString::to_string).collect();
        let _ = writeln!(text, ",{}", names.join("; "));
    }
    text
}
