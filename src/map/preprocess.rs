//! Prepares a frame for alignment, from its file.

use super::blocks::Blocks;
use super::frame_report::Stages;
use super::nearest::Nearest;
use super::orb::Features;
use super::point::{Noise, Point};
use super::rolling::Velocity;
use super::voxel::{Voxels, points_of};
use super::{Init, Method, Options};
use crate::camera::{Camera, Rays};
use crate::correct::{Conditions, Correction};
use crate::error::Result;
use crate::frame::{DepthTable, Frame};
use crate::io::ColourImage;
use crate::model::NoiseModel;
use crate::sequence::{Moment, Sequence};

/// The points of a frame, in the form its method needs.
pub enum Shape {
    Cloud(Nearest),
    Blocks(Blocks, Vec<Point>),
}

impl Shape {
    pub fn points(&self) -> &[Point] {
        match self {
            Shape::Cloud(cloud) => cloud.points(),
            Shape::Blocks(_, points) => points,
        }
    }

    /// As [`Blocks::straightened`]; a cloud of voxels, which mix image rows, is left unchanged.
    pub fn straighten(&mut self, velocity: &Velocity, camera: &Camera, readout_s: f64) {
        if let Shape::Blocks(blocks, points) = self {
            *blocks = blocks.straightened(velocity, camera, readout_s);
            *points = listed(blocks);
        }
    }
}

/// Points of the blocks that have one.
fn listed(blocks: &Blocks) -> Vec<Point> {
    blocks.points.iter().flatten().copied().collect()
}

/// A frame ready to be aligned, or to be aligned to.
pub struct Prepared {
    pub shape: Shape,
    pub features: Option<Features>,
    pub colour: Option<ColourImage>,
    pub colour_stamp: Option<f64>,
    /// As stored.
    pub raw: Frame,
    pub stages: Stages,
    /// A problem with its files.
    pub remark: Option<String>,
}

pub struct Preprocessor<'a> {
    pub sequence: &'a Sequence,
    pub options: &'a Options,
    noise: Noise,
    correction: Correction,
    table: DepthTable,
    rays: Rays,
}

impl<'a> Preprocessor<'a> {
    /// Fails when the model is of another sensor.
    pub fn new(sequence: &'a Sequence, model: &NoiseModel, options: &'a Options) -> Result<Self> {
        Ok(Preprocessor {
            sequence,
            options,
            noise: Noise::of(model),
            correction: Correction::of(model, &sequence.sensor)?,
            table: sequence.sensor.code.table(),
            rays: sequence.sensor.camera.rays(),
        })
    }

    /// Remark on what the model needs to know about this film and is not told.
    pub fn remark(&self) -> Option<String> {
        let place = self.sequence.root.display().to_string();
        let missing = self.sequence.temperature_c.is_none();
        missing.then(|| self.correction.remark_without_temperature(&place)).flatten()
    }

    /// Reads and prepares a frame. Fails when the depth image cannot be read, or OpenCV fails.
    pub fn prepare(&self, moment: &Moment) -> Result<Prepared> {
        let mut stages = Stages::default();
        let raw = stages.time("decode", || self.sequence.depth(moment))?;
        let depth = stages.time("unproject", || self.corrected(&raw, moment))?;
        let (mut colour, mut remark) = (None, None);
        if self.options.colour || self.options.init == Init::Orb {
            match stages.time("colour", || self.sequence.colour(moment)) {
                Ok(image) => colour = image,
                Err(e) => remark = Some(format!("{e}; the frame is mapped without colour")),
            }
        }
        let features = match &colour {
            Some(image) if self.options.init == Init::Orb => {
                Some(stages.time("orb", || Features::of(image, &depth, &self.rays))?)
            }
            _ => None,
        };
        let shape = self.shape(&depth, &mut stages);
        let colour_stamp = moment.colour.as_ref().map(|c| c.timestamp);
        Ok(Prepared { shape, features, colour, colour_stamp, raw, stages, remark })
    }

    /// Depth, m, with the sensor's biases corrected.
    fn corrected(&self, raw: &Frame, moment: &Moment) -> Result<Vec<f32>> {
        let mut depth = self.table.depths(raw);
        self.correction.apply(&mut depth, &Conditions::of(moment, self.sequence))?;
        Ok(depth)
    }

    fn shape(&self, depth: &[f32], stages: &mut Stages) -> Shape {
        let (options, rays, noise) = (self.options, &self.rays, &self.noise);
        match options.method {
            Method::Paper => {
                let side = options.voxel_m;
                let voxels = stages.time("voxel", || Voxels::of(depth, rays, side));
                let points = stages.time("normals", || points_of(&voxels, noise));
                let index = || Nearest::new(points, side, options.max_correspondence_m);
                Shape::Cloud(stages.time("index", index))
            }
            Method::Projective | Method::Model => {
                let camera = &self.sequence.sensor.camera;
                let blocks = || Blocks::of(depth, camera, rays, options.block_px, noise);
                let blocks = stages.time("blocks", blocks);
                let points = listed(&blocks);
                Shape::Blocks(blocks, points)
            }
        }
    }
}
