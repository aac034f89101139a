//! A frame from its file to what an alignment needs.

use std::time::Instant;

use super::blocks::Blocks;
use super::features::Features;
use super::nearest::Nearest;
use super::noise::Noise;
use super::normals::points_of;
use super::options::{Init, Method, Options};
use super::point::Point;
use super::stages::Stages;
use super::voxel::Voxels;
use crate::camera::Rays;
use crate::correct::{Conditions, Correction};
use crate::error::Result;
use crate::frame::{DepthTable, Frame};
use crate::io::ColourImage;
use crate::model::NoiseModel;
use crate::sequence::{Moment, Sequence, metres};

/// The points of a frame, as its method wants them.
#[derive(Debug, Clone)]
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
}

/// A frame, ready to be aligned and to be aligned to.
#[derive(Debug, Clone)]
pub struct Prepared {
    pub shape: Shape,
    pub features: Option<Features>,
    pub colour: Option<ColourImage>,
    /// Are its words those of the frame before?
    pub words: Frame,
    pub stages: Stages,
    /// What was odd about it, in words.
    pub remark: Option<String>,
}

/// All that frames share.
#[derive(Debug, Clone)]
pub struct Kitchen<'a> {
    pub sequence: &'a Sequence,
    pub options: &'a Options,
    noise: Noise,
    correction: Option<Correction>,
    table: DepthTable,
    rays: Rays,
    begin: f64,
}

impl<'a> Kitchen<'a> {
    /// # Errors
    /// When the model is of another sensor.
    pub fn new(sequence: &'a Sequence, model: &NoiseModel, options: &'a Options) -> Result<Self> {
        let correction = Correction::of(model, &sequence.sensor)?;
        Ok(Kitchen {
            sequence,
            options,
            noise: Noise::of(model),
            correction: (!correction.is_identity()).then_some(correction),
            table: sequence.sensor.code.table(),
            rays: sequence.sensor.camera.rays(),
            begin: sequence.moments.first().map_or(0.0, |m| m.stamp),
        })
    }

    /// What is odd about model and sensor together.
    pub fn remarks(&self) -> Vec<String> {
        self.correction.as_ref().map(|c| c.remarks().to_vec()).unwrap_or_default()
    }

    /// # Errors
    /// When the depth image cannot be read.
    pub fn prepare(&self, moment: &Moment) -> Result<Prepared> {
        let mut stages = Stages::default();
        let words = stages.time("decode", || self.sequence.raw_depth(moment))?;
        let depth = stages.time("unproject", || self.metres(&words, moment))?;
        let mut remark = None;
        let wanted = self.options.colour || self.options.init == Init::Orb;
        let colour = if wanted {
            stages.time("colour", || self.sequence.colour(moment)).unwrap_or_else(|e| {
                remark = Some(format!("{e}; the frame is mapped without colour"));
                None
            })
        } else {
            None
        };
        let features = match &colour {
            Some(image) if self.options.init == Init::Orb => {
                Some(stages.time("orb", || Features::of(image, &depth, &self.rays))?)
            }
            _ => None,
        };
        let shape = self.shape(&depth, &mut stages);
        Ok(Prepared { shape, features, colour, words, stages, remark })
    }

    fn metres(&self, words: &Frame, moment: &Moment) -> Result<Vec<f32>> {
        let mut depth = metres(words, &self.table);
        if let Some(correction) = &self.correction {
            let conditions =
                Conditions { session_s: moment.stamp - self.begin, ..Conditions::default() };
            correction.apply(&mut depth, &conditions)?;
        }
        Ok(depth)
    }

    fn shape(&self, depth: &[f32], stages: &mut Stages) -> Shape {
        let options = self.options;
        match options.method {
            Method::Paper => {
                let side = options.voxel_m;
                let voxels = stages.time("voxel", || Voxels::of(depth, &self.rays, side));
                let points = stages.time("normals", || points_of(&voxels, &self.noise));
                let index = || Nearest::new(points, side, options.gate_m);
                Shape::Cloud(stages.time("index", index))
            }
            Method::Projective | Method::Model => {
                let camera = &self.sequence.sensor.camera;
                let side = options.block_px;
                let blocks = stages
                    .time("blocks", || Blocks::of(depth, camera, &self.rays, side, &self.noise));
                let points = blocks.points.iter().flatten().copied().collect();
                Shape::Blocks(blocks, points)
            }
        }
    }
}

impl Stages {
    /// Run and measure.
    pub fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> T) -> T {
        let begin = Instant::now();
        let done = work();
        self.add(name, begin.elapsed().as_secs_f64() * 1e3);
        done
    }
}
