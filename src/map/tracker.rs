//! Frame after frame: start, align, judge, keep.

use nalgebra::{Isometry3, Matrix6};

use super::direction::Direction;
use super::grid_map::{GridMap, MapPoint, colour_or_grey};
use super::icp::{Alignment, Ending, align, renormalised};
use super::options::{Init, Options};
use super::prepare::{Kitchen, Prepared, Shape};
use super::projective::Projective;
use super::stages::Stages;
use super::surfels::{Fusion, Observed, Seen, Surfels};
use crate::camera::Camera;
use crate::error::Result;

/// What became of a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Fate {
    /// The map's frame is this camera's.
    First,
    Tracked,
    /// No pose: why, in words.
    Lost(String),
}

/// What is known of a frame in the end.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameReport {
    pub stamp: f64,
    pub fate: Fate,
    /// Where the camera was, `map_from_camera`; `None` when lost.
    pub pose: Option<Isometry3<f64>>,
    /// Of the last alignment, shift and turn, m and rad.
    pub covariance: Option<Matrix6<f64>>,
    pub iterations: usize,
    pub matched: f64,
    pub pairs: usize,
    pub rms_m: f64,
    pub undetermined: Vec<Direction>,
    pub weakest: f64,
    /// Are the depth words those of the frame before, every one?
    pub repeated: bool,
    pub stages: Stages,
}

impl FrameReport {
    /// A frame whose depth image cannot be read.
    pub fn unread(stamp: f64, why: String) -> Self {
        Self::lost(stamp, why, Stages::default())
    }

    fn lost(stamp: f64, why: String, stages: Stages) -> Self {
        FrameReport {
            stamp,
            fate: Fate::Lost(why),
            pose: None,
            covariance: None,
            iterations: 0,
            matched: 0.0,
            pairs: 0,
            rms_m: 0.0,
            undetermined: Vec::new(),
            weakest: 0.0,
            repeated: false,
            stages,
        }
    }
}

/// Fewer points are no picture of anything.
const MIN_POINTS: usize = 200;
/// From frame to frame the share of points with a neighbour falls to .94 of what it was at worst on
/// fr1_rpy and 7-Scenes; a metre away in the same room floor and walls still match, at .36 to .48.
const MIN_KEPT: f64 = 0.6;
/// Pieces of the map are sorted out every so many frames.
const PRUNE_EVERY: u32 = 10;

/// The state between frames.
pub struct Tracker<'a> {
    options: &'a Options,
    camera: &'a Camera,
    /// The last frame with a pose.
    last: Option<Prepared>,
    /// Its pose, and its motion since the one before.
    pose: Isometry3<f64>,
    motion: Isometry3<f64>,
    /// Share of its points that had a neighbour.
    matched: f64,
    surfels: Surfels,
    grid: GridMap,
    number: u32,
}

impl<'a> Tracker<'a> {
    pub fn new(kitchen: &Kitchen<'a>) -> Self {
        Tracker {
            options: kitchen.options,
            camera: &kitchen.sequence.sensor.camera,
            last: None,
            pose: Isometry3::identity(),
            motion: Isometry3::identity(),
            matched: 0.0,
            surfels: Surfels::default(),
            grid: GridMap::default(),
            number: 0,
        }
    }

    /// Take in a frame.
    ///
    /// # Errors
    /// When OpenCV fails.
    pub fn take(&mut self, stamp: f64, mut frame: Prepared) -> Result<FrameReport> {
        self.number += 1;
        let mut stages = std::mem::take(&mut frame.stages);
        let points = frame.shape.points().len();
        if points < MIN_POINTS {
            let why = format!("{points} points with a surface, {MIN_POINTS} are needed");
            return Ok(FrameReport::lost(stamp, why, stages));
        }
        let Some(last) = &self.last else {
            self.keep(frame, Isometry3::identity(), &mut stages);
            return Ok(FrameReport {
                fate: Fate::First,
                pose: Some(Isometry3::identity()),
                matched: 1.0,
                ..FrameReport::lost(stamp, String::new(), stages)
            });
        };
        let repeated = last.words == frame.words;
        let start = stages.time("start", || self.start(last, &frame))?;
        let alignment = self.align(last, &frame, start, &mut stages);
        let mut report = FrameReport {
            iterations: alignment.iterations,
            matched: alignment.matched,
            pairs: alignment.pairs,
            rms_m: alignment.rms_m,
            weakest: alignment.weakest,
            repeated,
            ..FrameReport::lost(stamp, String::new(), Stages::default())
        };
        match self.doubt(&alignment) {
            Some(why) => report.fate = Fate::Lost(why),
            None => {
                let relative = alignment.target_from_source;
                report.fate = Fate::Tracked;
                report.covariance = Some(alignment.covariance);
                report.undetermined = alignment.undetermined;
                let pose = renormalised(&(self.pose * relative));
                report.pose = Some(pose);
                self.matched = report.matched;
                self.keep(frame, pose, &mut stages);
            }
        }
        report.stages = stages;
        Ok(report)
    }

    /// Where this frame may be in the last one's.
    fn start(&self, last: &Prepared, frame: &Prepared) -> Result<Isometry3<f64>> {
        let moved = match self.options.init {
            Init::None => Isometry3::identity(),
            Init::Motion | Init::Orb => self.motion,
        };
        if self.options.init != Init::Orb {
            return Ok(moved);
        }
        let (Some(here), Some(there)) = (&frame.features, &last.features) else {
            return Ok(moved);
        };
        let mut rng = self.options.seed.stream(&format!("orb/{}", self.number));
        let told = here.motion_to(there, &mut rng)?;
        Ok(told.map_or(moved, |t| t.target_from_source))
    }

    /// In the frame of the last camera.
    fn align(
        &self,
        last: &Prepared,
        frame: &Prepared,
        start: Isometry3<f64>,
        stages: &mut Stages,
    ) -> Alignment {
        let criteria = self.options.criteria();
        let source = frame.shape.points();
        let gate_m = self.options.gate_m;
        match (&last.shape, self.options.method) {
            (Shape::Cloud(target), _) => {
                stages.time("icp", || align(source, target, start, &criteria))
            }
            (Shape::Blocks(blocks, _), super::options::Method::Projective) => {
                let target = Projective { camera: self.camera, blocks, gate_m };
                stages.time("icp", || align(source, &target, start, &criteria))
            }
            (Shape::Blocks(..), _) => {
                let sight = stages.time("render", || self.sight(&(self.pose * start)));
                let target = Seen { surfels: &self.surfels.surfels, sight: &sight, gate_m };
                let found =
                    stages.time("icp", || align(source, &target, self.pose * start, &criteria));
                let target_from_source = self.pose.inverse() * found.target_from_source;
                Alignment { target_from_source, ..found }
            }
        }
    }

    fn sight(&self, pose: &Isometry3<f64>) -> super::surfels::Sight<'a> {
        self.surfels.seen_from(pose, self.camera, self.options.block_px)
    }

    /// Why an alignment is not to be believed.
    fn doubt(&self, alignment: &Alignment) -> Option<String> {
        let pose = &alignment.target_from_source;
        let finite = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
        if alignment.ending == Ending::TooFewPairs || !finite.into_iter().all(|v| v.is_finite()) {
            return Some("too few points find a neighbour".into());
        }
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let (here, before) = (percent(alignment.matched), percent(self.matched));
        if alignment.matched < self.options.min_matched {
            let needed = percent(self.options.min_matched);
            return Some(format!("{here} of the points find a neighbour, {needed} are needed"));
        }
        (alignment.matched < MIN_KEPT * self.matched).then(|| {
            format!(
                "{here} of the points find a neighbour, {before} did before: a jump, or gone astray"
            )
        })
    }

    /// Make a frame part of the map and the one to go on from.
    fn keep(&mut self, frame: Prepared, pose: Isometry3<f64>, stages: &mut Stages) {
        let first = self.last.is_none();
        if !first {
            self.motion = renormalised(&(self.pose.inverse() * pose));
        }
        self.pose = pose;
        stages.time("fuse", || self.fuse(&frame));
        self.last = Some(frame);
    }

    fn fuse(&mut self, frame: &Prepared) {
        let colour = frame.colour.as_ref().map(|c| c.rgb.as_slice());
        match (&frame.shape, self.options.method) {
            (Shape::Blocks(blocks, _), super::options::Method::Model) => {
                let sight = self.sight(&self.pose);
                let observed =
                    Observed { number: self.number, focal_px: self.camera.fx as f32, colour };
                let fusion = Fusion { max_counted: self.options.max_counted };
                self.surfels.fuse(&sight, blocks, &self.pose, &observed, &fusion);
                if self.number.is_multiple_of(PRUNE_EVERY) {
                    self.surfels.prune(self.number);
                }
            }
            (shape, _) => self.grid.add(shape.points(), &self.pose, colour),
        }
    }

    /// The finished map.
    pub fn into_map(self) -> Vec<MapPoint> {
        if self.surfels.surfels.is_empty() {
            return self.grid.points();
        }
        let point = |s: &super::surfels::Surfel| MapPoint {
            at: s.point.at,
            normal: s.point.normal,
            sigma: s.point.across,
            colour: colour_or_grey(s.colour, if s.coloured > 0 { 1.0 } else { 0.0 }),
        };
        self.surfels.surfels.iter().map(point).collect()
    }
}
