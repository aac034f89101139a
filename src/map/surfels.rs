//! The map as small pieces of surface (surfels). Each observation makes a surfel more certain, and new
//! frames are aligned to the surfels (after Keller et al., "Real-time 3D reconstruction in dynamic scenes
//! using point-based fusion", 3DV 2013).

use nalgebra::{Isometry3, Vector3};

use super::blocks::Blocks;
use super::icp::{SOUND_MISFIT, Target};
use super::index_map::{IndexMap, SIGMAS, joint, within};
use super::map_points::{MapPoint, colour_of, mean_colour};
use super::point::{Motion, Point};
use crate::camera::Camera;

/// A piece of the map; its point's `sigma_normal` is the standard deviation of its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surfel {
    /// In the map's frame.
    point: Point,
    seen: u32,
    /// Number of the frame that saw it last.
    last: u32,
    /// Red, green and blue, 0 to 255; mean over the observations with colour.
    colour: Vector3<f32>,
    coloured: u32,
}

pub struct Surfels {
    surfels: Vec<Surfel>,
    /// A surfel never counts for more than this many of its observations: the poses err too, and that error
    /// does not average out.
    max_observations: f32,
}

/// Distance allowed between a surfel and an observation beyond [`SIGMAS`], m, for the error of the pose.
const POSE_M: f32 = 0.01;
/// Least cosine between their normals: 37 degrees.
const MIN_COSINE: f32 = 0.8;
/// Largest distance between them along the surface, block widths.
const MAX_WIDTHS_APART: f32 = 1.0;
/// Observations that confirm a surfel.
const CONFIRMED: u32 = 3;
/// Frames after the last observation within which an unconfirmed surfel is kept.
const PROBATION: u32 = 30;

/// Averages of fewer are as noisy as the frames themselves.
const MIN_OBSERVATIONS: f32 = 3.0;

impl Surfels {
    pub fn new(max_observations: f32) -> Self {
        Surfels { surfels: Vec::new(), max_observations }
    }

    pub fn is_empty(&self) -> bool {
        self.surfels.is_empty()
    }

    /// Renders what a camera with blocks of `side_px` would see.
    pub fn seen_from<'a>(
        &self,
        map_from_camera: &Isometry3<f64>,
        camera: &'a Camera,
        side_px: usize,
    ) -> IndexMap<'a> {
        let points = self.surfels.iter().map(|s| &s.point);
        IndexMap::render(points, map_from_camera, camera, side_px)
    }

    /// Sets how many observations count at most. Where residuals are larger than the noise model expects, the
    /// poses err more and old observations are worth less, so fewer count.
    pub fn remember(&mut self, max_observations: f32, misfit: f64) {
        let held =
            if misfit.is_finite() { (SOUND_MISFIT / misfit).powi(2).min(1.0) as f32 } else { 1.0 };
        self.max_observations =
            (held * max_observations).max(MIN_OBSERVATIONS.min(max_observations));
    }

    /// Fuses the points of frame `number`, with its colours. `index_map` is rendered from about this pose.
    pub fn fuse(
        &mut self,
        index_map: &IndexMap<'_>,
        blocks: &Blocks,
        map_from_camera: &Isometry3<f64>,
        number: u32,
        rgb: Option<&[u8]>,
    ) {
        let motion = Motion::of(map_from_camera);
        for point in blocks.points.iter().flatten() {
            let facing = -point.normal.dot(&point.at) / point.at.norm();
            // A block is longer on a slanted surface.
            let focal_px = index_map.camera.fx as f32;
            let width_m = blocks.side_px as f32 * point.at.z / focal_px / facing;
            let moved = Point {
                at: motion.moved(&point.at),
                normal: motion.turned(&point.normal),
                ..*point
            };
            let colour = rgb.map(|rgb| colour_of(rgb, point.pixel));
            match self.associate(index_map, &moved, width_m) {
                Association::Known(i) => {
                    self.surfels[i].observe(&moved, colour, number, self.max_observations);
                }
                Association::New => self.surfels.push(Surfel {
                    point: moved,
                    seen: 1,
                    last: number,
                    colour: colour.unwrap_or_default(),
                    coloured: u32::from(colour.is_some()),
                }),
                Association::Conflict => {}
            }
        }
    }

    /// Finds the surfel that a point in the map frame, `width_m` wide, belongs to.
    fn associate(&self, index_map: &IndexMap<'_>, p: &Point, width_m: f32) -> Association {
        let Some(block) = index_map.block(&p.at) else { return Association::New };
        let mut best: Option<(f32, usize)> = None;
        for i in index_map.around(block) {
            let surfel = &self.surfels[i].point;
            let (along, normal, limit) = apart(p, surfel);
            if normal < limit
                && along < MAX_WIDTHS_APART * width_m
                && p.normal.dot(&surfel.normal) > MIN_COSINE
                && best.is_none_or(|(nearest, _)| along < nearest)
            {
                best = Some((along, i));
            }
        }
        if let Some((_, i)) = best {
            return Association::Known(i);
        }
        // A point slightly in front of or behind a surface seen more than CONFIRMED times is a mistake.
        let doubtful = index_map.front(block).is_some_and(|i| {
            let (_, normal, limit) = apart(p, &self.surfels[i].point);
            normal < 2.0 * limit && self.surfels[i].seen > CONFIRMED
        });
        if doubtful { Association::Conflict } else { Association::New }
    }

    /// Removes surfels with fewer than CONFIRMED observations, the last of them PROBATION frames ago or more.
    pub fn prune(&mut self, now: u32) {
        self.surfels.retain(|s| s.seen >= CONFIRMED || now.saturating_sub(s.last) < PROBATION);
    }

    pub fn points(&self) -> Vec<MapPoint> {
        let point = |s: &Surfel| MapPoint {
            at: s.point.at,
            normal: s.point.normal,
            sigma: s.point.sigma_normal,
            colour: mean_colour(s.colour, if s.coloured > 0 { 1.0 } else { 0.0 }),
        };
        self.surfels.iter().map(point).collect()
    }
}

/// How an observation relates to the map.
enum Association {
    Known(usize),
    New,
    /// Doubtful and on no known surface: it is dropped.
    Conflict,
}

/// Distance of a point from a surfel along its surface and along its normal, and the limit along the
/// normal if they are one surface, m.
fn apart(p: &Point, surfel: &Point) -> (f32, f32, f32) {
    let off = p.at - surfel.at;
    let normal = off.dot(&surfel.normal);
    let along = (off.norm_squared() - normal * normal).max(0.0).sqrt();
    let limit = SIGMAS * joint(p.sigma_normal, surfel.sigma_normal) + POSE_M;
    (along, normal.abs(), limit)
}

impl Surfel {
    /// Averages in an observation; at most `max` of them count.
    fn observe(&mut self, p: &Point, colour: Option<Vector3<f32>>, number: u32, max: f32) {
        let (mine, new) = (self.point.sigma_normal.powi(-2), p.sigma_normal.powi(-2));
        let share = new / (mine + new);
        // Only along the normal: along the surface there is nothing to average.
        let off = (p.at - self.point.at).dot(&self.point.normal);
        self.point.at += self.point.normal * (share * off);
        let normal = self.point.normal * (1.0 - share) + p.normal * share;
        self.point.normal = normal.try_normalize(f32::MIN_POSITIVE).unwrap_or(self.point.normal);
        self.point.sigma_axial = p.sigma_axial;
        self.point.sigma_normal = (mine + new).min(new * max).max(mine).powf(-0.5);
        self.seen += 1;
        self.last = number;
        if let Some(colour) = colour {
            self.coloured += 1;
            self.colour += (colour - self.colour) / self.coloured as f32;
        }
    }
}

/// The surfels that an index map shows, as alignment target.
pub struct SurfelTarget<'a> {
    pub surfels: &'a Surfels,
    pub index_map: &'a IndexMap<'a>,
    /// Largest distance of a neighbour, m.
    pub max_correspondence_m: f32,
}

impl Target for SurfelTarget<'_> {
    type Cache = ();

    #[inline]
    fn find(&self, p: &Vector3<f32>, (): &mut ()) -> Option<&Point> {
        let block = self.index_map.block(p)?;
        let surfels = &self.surfels.surfels;
        let near = |i: usize| within(&surfels[i].point, p, self.max_correspondence_m);
        self.index_map.front(block).and_then(near).or_else(|| {
            let squared = |point: &Point| (point.at - p).norm_squared();
            let candidates = self.index_map.around(block).filter_map(near);
            candidates.min_by(|a, b| squared(a).total_cmp(&squared(b)))
        })
    }

    fn block_width(&self) -> Option<f32> {
        Some(self.index_map.block_width())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_the_noise_model_explains_less_less_is_remembered() {
        let after = |max, misfit| {
            let mut surfels = Surfels::new(max);
            surfels.remember(max, misfit);
            surfels.max_observations
        };
        assert_eq!(after(30.0, f64::INFINITY), 30.0, "no misfit is known");
        assert_eq!(after(30.0, 1.0), 30.0);
        assert!((after(30.0, 2.0 * SOUND_MISFIT) - 7.5).abs() < 1e-3);
        assert_eq!(after(30.0, 10.0), MIN_OBSERVATIONS);
        assert_eq!(after(2.0, 10.0), 2.0, "never more than asked for");
    }
}
