//! Tracks the camera frame by frame: start, align, judge, fuse.

use nalgebra::Isometry3;

use super::frame_report::{Fate, FrameReport, Stages};
use super::icp::{Alignment, Termination, align, renormalised};
use super::index_map::Projective;
use super::map_points::{MapPoint, PointGrid};
use super::preprocess::{Prepared, Preprocessor, Shape};
use super::rolling::Velocity;
use super::surfels::{SurfelTarget, Surfels};
use super::{Init, Method, Options};
use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::trajectory::Pose;

/// Fewest points in a usable frame.
const MIN_POINTS: usize = 200;
/// Least share of points with a neighbour, relative to the frame before. It falls to 0.94 at worst on fr1_rpy
/// and 7-Scenes; from a metre away in the same room floor and walls still match, at 0.36 to 0.48.
const MIN_RATIO_KEPT: f64 = 0.6;
/// Surfels are pruned every this many frames.
const PRUNE_EVERY: u32 = 10;

pub struct Tracker<'a> {
    options: &'a Options,
    camera: &'a Camera,
    /// The last frame with a pose.
    last: Option<Prepared>,
    /// Its stamp, s, its pose, and its motion and time, s, since the one before.
    stamp: f64,
    pose: Isometry3<f64>,
    motion: (Isometry3<f64>, f64),
    /// Its pose from the features of the colour images alone.
    pose_by_colour: Isometry3<f64>,
    /// Share of its points with a neighbour.
    inlier_ratio: f64,
    surfels: Surfels,
    grid: PointGrid,
    number: u32,
}

impl<'a> Tracker<'a> {
    pub fn new(preprocessor: &Preprocessor<'a>) -> Self {
        Tracker {
            options: preprocessor.options,
            camera: &preprocessor.sequence.sensor.camera,
            last: None,
            stamp: 0.0,
            pose: Isometry3::identity(),
            motion: (Isometry3::identity(), 0.0),
            pose_by_colour: Isometry3::identity(),
            inlier_ratio: 0.0,
            surfels: Surfels::new(preprocessor.options.max_observations),
            grid: PointGrid::default(),
            number: 0,
        }
    }

    /// Tracks a frame; one that could not be read is lost.
    /// Fails when OpenCV fails.
    pub fn track(&mut self, stamp: f64, frame: Result<Prepared>) -> Result<FrameReport> {
        let mut frame = match frame {
            Ok(frame) => frame,
            Err(e @ Error::Argument { .. }) => return Err(e),
            Err(e) => return Ok(FrameReport::lost(stamp, e.to_string())),
        };
        self.number += 1;
        let mut stages = std::mem::take(&mut frame.stages);
        let points = frame.shape.points().len();
        let few = format!("{points} points with a surface, {MIN_POINTS} are needed");
        let mut report =
            FrameReport { remark: frame.remark.take(), ..FrameReport::lost(stamp, few) };
        if points >= MIN_POINTS {
            self.follow(frame, &mut report, &mut stages)?;
        }
        report.stages = stages;
        Ok(report)
    }

    fn follow(
        &mut self,
        mut frame: Prepared,
        report: &mut FrameReport,
        stages: &mut Stages,
    ) -> Result<()> {
        let Some(last) = &self.last else {
            report.fate = Fate::First;
            report.pose = Some(Isometry3::identity());
            report.by_colour = by_colour(&frame, &self.pose_by_colour);
            self.stamp = report.stamp;
            self.keep(frame, Isometry3::identity(), stages);
            return Ok(());
        };
        report.repeated = last.raw == frame.raw;
        let seen = stages.time("start", || self.seen_motion(last, &frame))?;
        let in_colour = frame.features.is_some() && last.features.is_some();
        let start = seen.unwrap_or_else(|| match self.options.init {
            Init::Motion => self.motion_by(report.stamp),
            Init::Orb if in_colour => self.motion_by(report.stamp),
            Init::Orb | Init::None => Isometry3::identity(),
        });
        let mut alignment = self.align(last, &frame, start, stages);
        if self.options.readout_s > 0.0 {
            // The motion is now known, so the rolling shutter can be corrected.
            let moved = alignment.target_from_source;
            let velocity = Velocity::of(&moved, report.stamp - self.stamp);
            frame.shape.straighten(&velocity, self.camera, self.options.readout_s);
            alignment = self.align(last, &frame, moved, stages);
        }
        if let Some(why) = self.doubt(&alignment) {
            report.fate = Fate::Lost(why);
        } else {
            let pose = renormalised(&(self.pose * alignment.target_from_source));
            report.fate = Fate::Tracked;
            report.pose = Some(pose);
            self.inlier_ratio = alignment.inlier_ratio;
            self.surfels.remember(self.options.max_observations, alignment.misfit);
            let moved = seen.unwrap_or(alignment.target_from_source);
            self.pose_by_colour = renormalised(&(self.pose_by_colour * moved));
            report.by_colour = seen.and(by_colour(&frame, &self.pose_by_colour));
            self.motion = (alignment.target_from_source, report.stamp - self.stamp);
            self.stamp = report.stamp;
            self.keep(frame, pose, stages);
        }
        report.alignment = Some(alignment);
        Ok(())
    }

    /// Motion since the last frame with a pose, by its velocity; over a longer gap than a few of its intervals
    /// nobody knows it.
    fn motion_by(&self, stamp: f64) -> Isometry3<f64> {
        const MAX_INTERVALS: f64 = 3.0;
        let (motion, seconds) = &self.motion;
        let since = (stamp - self.stamp).min(MAX_INTERVALS * seconds);
        Velocity::of(motion, *seconds).after(since)
    }

    /// Pose of this frame in the last one, from features of their colour images, if requested.
    fn seen_motion(&self, last: &Prepared, frame: &Prepared) -> Result<Option<Isometry3<f64>>> {
        let (Some(here), Some(there)) = (&frame.features, &last.features) else {
            return Ok(None);
        };
        let mut rng = self.options.seed.stream(&format!("orb/{}", self.number));
        here.motion_to(there, &mut rng)
    }

    /// Aligns a frame; the result is in the frame of the last camera. With the model its covariance and its
    /// degenerate directions are in the map's.
    fn align(
        &self,
        last: &Prepared,
        frame: &Prepared,
        start: Isometry3<f64>,
        stages: &mut Stages,
    ) -> Alignment {
        let options = self.options;
        let source = frame.shape.points();
        let max_correspondence_m = options.max_correspondence_m;
        match &last.shape {
            Shape::Cloud(target) => stages.time("icp", || align(source, target, start, options)),
            Shape::Blocks(blocks, _) if options.method == Method::Projective => {
                let target = Projective::new(self.camera, blocks, max_correspondence_m);
                stages.time("icp", || align(source, &target, start, options))
            }
            Shape::Blocks(..) => {
                let start = self.pose * start;
                let seen = || self.surfels.seen_from(&start, self.camera, options.block_px);
                let index_map = stages.time("render", seen);
                let (surfels, index_map) = (&self.surfels, &index_map);
                let target = SurfelTarget { surfels, index_map, max_correspondence_m };
                let found = stages.time("icp", || align(source, &target, start, options));
                let target_from_source = self.pose.inverse() * found.target_from_source;
                Alignment { target_from_source, ..found }
            }
        }
    }

    /// Why an alignment must be rejected, if it must.
    fn doubt(&self, alignment: &Alignment) -> Option<String> {
        let pose = &alignment.target_from_source;
        let mut numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
        if alignment.termination == Termination::TooFewCorrespondences
            || !numbers.all(|v| v.is_finite())
        {
            return Some("too few points find a neighbour".into());
        }
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let (here, before) = (percent(alignment.inlier_ratio), percent(self.inlier_ratio));
        if alignment.inlier_ratio < self.options.min_inlier_ratio {
            let needed = percent(self.options.min_inlier_ratio);
            return Some(format!("{here} of the points find a neighbour, {needed} are needed"));
        }
        (alignment.inlier_ratio < MIN_RATIO_KEPT * self.inlier_ratio).then(|| {
            format!(
                "{here} of the points find a neighbour, {before} did before: a jump, or gone astray"
            )
        })
    }

    /// Fuses a frame into the map and makes it the last frame.
    fn keep(&mut self, frame: Prepared, pose: Isometry3<f64>, stages: &mut Stages) {
        self.pose = pose;
        stages.time("fuse", || self.fuse(&frame));
        self.last = Some(frame);
    }

    fn fuse(&mut self, frame: &Prepared) {
        let rgb = frame.colour.as_ref().map(|c| c.rgb.as_slice());
        match &frame.shape {
            Shape::Blocks(blocks, _) if self.options.method == Method::Model => {
                let index_map =
                    self.surfels.seen_from(&self.pose, self.camera, self.options.block_px);
                self.surfels.fuse(&index_map, blocks, &self.pose, self.number, rgb);
                if self.number.is_multiple_of(PRUNE_EVERY) {
                    self.surfels.prune(self.number);
                }
            }
            shape => self.grid.add(shape.points(), &self.pose, rgb),
        }
    }

    pub fn into_map(self) -> Vec<MapPoint> {
        if self.surfels.is_empty() { self.grid.points() } else { self.surfels.points() }
    }
}

fn by_colour(frame: &Prepared, pose: &Isometry3<f64>) -> Option<Pose> {
    let stamp = frame.colour_stamp.filter(|_| frame.features.is_some())?;
    Some(Pose { stamp, world_from_camera: *pose })
}
