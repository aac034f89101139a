//! ORB features of a colour image with their 3D positions, and the motion between two sets.
//!
//! Detector, descriptor and matcher are OpenCV's (Rublee et al., "ORB: an efficient alternative to
//! SIFT or SURF", ICCV 2011).

use nalgebra::{Isometry3, Vector3};
use opencv::core::{DMatch, KeyPoint, Mat, NORM_HAMMING, Vector, no_array};
use opencv::features2d::{BFMatcher, ORB, ORB_ScoreType};
use opencv::imgproc::{COLOR_RGB2GRAY, cvt_color_def};
use opencv::prelude::*;

use super::ransac::{PointPair, ransac};
use crate::camera::Rays;
use crate::error::{Error, Result};
use crate::io::ColourImage;
use crate::rng::Stream;

/// The paper's values; the others are OpenCV's defaults.
const FAST_THRESHOLD: i32 = 50;
const MAX_FEATURES: i32 = 500;

pub struct Features {
    descriptors: Mat,
    /// m, optical frame; `None` where no depth was measured.
    places: Vec<Option<Vector3<f64>>>,
}

impl Features {
    /// Detects features in a colour image, with the depth, m, of its pixels.
    /// Fails when OpenCV fails.
    pub fn of(image: &ColourImage, depth: &[f32], rays: &Rays) -> Result<Self> {
        Self::detect(image, depth, rays).map_err(failed)
    }

    fn detect(image: &ColourImage, depth: &[f32], rays: &Rays) -> opencv::Result<Self> {
        let flat = Mat::from_slice(&image.rgb)?;
        let colour = flat.reshape(3, image.height as i32)?;
        let mut grey = Mat::default();
        cvt_color_def(&colour, &mut grey, COLOR_RGB2GRAY)?;
        let mut orb = ORB::create(
            MAX_FEATURES,
            1.2,
            8,
            31,
            0,
            2,
            ORB_ScoreType::HARRIS_SCORE,
            31,
            FAST_THRESHOLD,
        )?;
        let mut keypoints = Vector::<KeyPoint>::new();
        let mut descriptors = Mat::default();
        orb.detect_and_compute_def(&grey, &no_array(), &mut keypoints, &mut descriptors)?;
        let place = |point: KeyPoint| {
            let (u, v) = (point.pt().x.round() as usize, point.pt().y.round() as usize);
            let i = v.min(image.height - 1) * image.width + u.min(image.width - 1);
            let z = f64::from(depth[i]);
            let (x, y) = rays.at(i);
            (z > 0.0 && z.is_finite()).then(|| Vector3::new(x * z, y * z, z))
        };
        Ok(Features { descriptors, places: keypoints.iter().map(place).collect() })
    }

    /// The motion from this frame to `target`: brute-force matches by Hamming distance with cross-check, and
    /// RANSAC. `None` where too few agree.
    /// Fails when OpenCV fails.
    pub fn motion_to(&self, target: &Features, rng: &mut Stream) -> Result<Option<Isometry3<f64>>> {
        let pairs = self.pairs(target).map_err(failed)?;
        Ok(ransac(&pairs, rng))
    }

    fn pairs(&self, target: &Features) -> opencv::Result<Vec<PointPair>> {
        if self.places.is_empty() || target.places.is_empty() {
            return Ok(Vec::new());
        }
        let matcher = BFMatcher::create(NORM_HAMMING, true)?;
        let mut matches = Vector::<DMatch>::new();
        matcher.train_match_def(&self.descriptors, &target.descriptors, &mut matches)?;
        let pair = |m: DMatch| {
            let to = target.places.get(m.train_idx as usize).copied().flatten()?;
            let from = self.places.get(m.query_idx as usize).copied().flatten()?;
            Some((to, from))
        };
        Ok(matches.iter().filter_map(pair).collect())
    }
}

fn failed(e: opencv::Error) -> Error {
    Error::Argument { what: format!("OpenCV: {e}"), remedy: "map without it: --init none" }
}
