//! The map as small pieces of surface: seen again, a piece gets surer; seen from elsewhere, it is
//! what the next frame aligns to (after Keller et al., "Real-time 3D reconstruction in dynamic
//! scenes using point-based fusion", 3DV 2013).

use nalgebra::{Isometry3, Vector3};

use super::blocks::Blocks;
use super::icp::Target;
use super::motion::Motion;
use super::point::Point;
use super::projective::block_of;
use crate::camera::Camera;

/// A piece of the map; its point's `across` is the standard deviation of where it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surfel {
    /// In the map's frame.
    pub point: Point,
    /// Times it was seen.
    pub seen: u32,
    /// Number of the frame that saw it last.
    pub last: u32,
    /// Red, green and blue, 0 to 255; a mean over the times it was seen in colour.
    pub colour: Vector3<f32>,
    pub coloured: u32,
}

/// All pieces.
#[derive(Debug, Clone, Default)]
pub struct Surfels {
    pub surfels: Vec<Surfel>,
}

/// How observations become pieces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fusion {
    /// A piece never counts for more than this many of its observations: the pose it was put down
    /// with errs too, and that error is not averaged away.
    pub max_counted: f32,
}

/// A piece and an observation are one surface when their distance across it is less than this many
/// standard deviations ...
const SIGMAS: f32 = 4.0;
/// ... and this, for the pose errs too, m.
const POSE_M: f32 = 0.01;
/// Least cosine between their normals: 37 degrees.
const SAME_NORMAL: f32 = 0.8;
/// Along the surface they are one when they are this many block widths apart or less.
const SAME_PLACE: f32 = 1.0;
/// A piece seen less often than this ...
const CONFIRMED: u32 = 3;
/// ... by the time this many frames have passed was a mistake.
const PROBATION: u32 = 30;

impl Surfels {
    /// Which pieces a camera would see: the nearest of each block.
    pub fn seen_from<'a>(
        &self,
        map_from_camera: &Isometry3<f64>,
        camera: &'a Camera,
        side_px: usize,
    ) -> Sight<'a> {
        let (width, height) = (camera.width / side_px, camera.height / side_px);
        let motion = Motion::of(&map_from_camera.inverse());
        let mut sight = Sight { camera, side_px, width, height, motion, front: Vec::new() };
        let mut front = vec![Front::default(); width * height];
        for (i, surfel) in self.surfels.iter().enumerate() {
            let at = motion.moved(&surfel.point.at);
            if at.z <= NEAREST_M {
                continue;
            }
            let Some(block) = sight.block(&at) else { continue };
            // From behind it is not seen.
            if motion.turned(&surfel.point.normal).dot(&at) < 0.0 {
                let sigma = surfel.point.across;
                front[block].meet(Front { z: at.z, sigma, surfel: i as u32 });
            }
        }
        sight.front = front.into_iter().map(|f| f.surfel).collect();
        sight
    }

    /// Take in what a frame saw. `sight` is that of about this pose.
    pub fn fuse(
        &mut self,
        sight: &Sight<'_>,
        blocks: &Blocks,
        map_from_camera: &Isometry3<f64>,
        frame: &Observed<'_>,
        fusion: &Fusion,
    ) {
        let motion = Motion::of(map_from_camera);
        for point in blocks.points.iter().flatten() {
            let facing = -point.normal.dot(&point.at) / point.at.norm();
            // On a slanted surface a block is longer.
            let width_m = blocks.side_px as f32 * point.at.z / frame.focal_px / facing;
            let moved = Point {
                at: motion.moved(&point.at),
                normal: motion.turned(&point.normal),
                ..*point
            };
            let colour = frame.colour.map(|rgb| colour_of(rgb, point.pixel));
            match sight.same(&self.surfels, &moved, width_m) {
                Same::Piece(i) => self.surfels[i].observe(&moved, colour, frame.number, fusion),
                Same::Nothing => self.surfels.push(Surfel {
                    point: moved,
                    seen: 1,
                    last: frame.number,
                    colour: colour.unwrap_or_default(),
                    coloured: u32::from(colour.is_some()),
                }),
                Same::Conflict => {}
            }
        }
    }

    /// Take out what was seen once or twice and never again.
    pub fn prune(&mut self, now: u32) {
        self.surfels.retain(|s| s.seen >= CONFIRMED || now.saturating_sub(s.last) < PROBATION);
    }
}

/// A frame beside its depth.
#[derive(Debug, Clone, Copy)]
pub struct Observed<'a> {
    pub number: u32,
    pub focal_px: f32,
    /// Red, green, blue, row-major.
    pub colour: Option<&'a [u8]>,
}

/// Red, green and blue of a pixel.
pub fn colour_of(rgb: &[u8], pixel: u32) -> Vector3<f32> {
    let i = 3 * pixel as usize;
    Vector3::new(rgb[i], rgb[i + 1], rgb[i + 2]).map(f32::from)
}

impl Surfel {
    fn observe(&mut self, p: &Point, colour: Option<Vector3<f32>>, number: u32, fusion: &Fusion) {
        let (mine, new) = (self.point.across.powi(-2), p.across.powi(-2));
        let share = new / (mine + new);
        // Only across the surface: along it there is nothing to average.
        let off = (p.at - self.point.at).dot(&self.point.normal);
        self.point.at += self.point.normal * (share * off);
        let normal = self.point.normal * (1.0 - share) + p.normal * share;
        self.point.normal = normal.try_normalize(f32::MIN_POSITIVE).unwrap_or(self.point.normal);
        self.point.axial = p.axial;
        self.point.across = (mine + new).min(new * fusion.max_counted).max(mine).powf(-0.5);
        self.seen += 1;
        self.last = number;
        if let Some(colour) = colour {
            self.coloured += 1;
            self.colour += (colour - self.colour) / self.coloured as f32;
        }
    }
}

const NOBODY: u32 = u32::MAX;

/// The piece that a block shows.
#[derive(Debug, Clone, Copy)]
struct Front {
    z: f32,
    sigma: f32,
    surfel: u32,
}

impl Default for Front {
    fn default() -> Self {
        Front { z: f32::INFINITY, sigma: f32::INFINITY, surfel: NOBODY }
    }
}

impl Front {
    /// The nearer hides the farther; of two that may be one surface the surer shows. (The nearer of
    /// those would be the one with the greater error: the map would come towards the camera.)
    fn meet(&mut self, other: Front) {
        let apart = SIGMAS * both(self.sigma.min(1.0), other.sigma) + HIDES_M;
        let nearer = other.z < self.z - apart;
        let one_surface = (other.z - self.z).abs() <= apart;
        if nearer || one_surface && other.sigma < self.sigma || self.surfel == NOBODY {
            *self = other;
        }
    }
}

/// Of a difference.
#[inline]
fn both(a: f32, b: f32) -> f32 {
    (a * a + b * b).sqrt()
}

/// What hides is nearer by at least this: a block of a slanted surface is as deep, m.
const HIDES_M: f32 = 0.03;
/// Nothing is measured nearer, m.
const NEAREST_M: f32 = 0.2;

/// Which pieces a camera sees, and where it is.
#[derive(Debug, Clone)]
pub struct Sight<'a> {
    camera: &'a Camera,
    side_px: usize,
    width: usize,
    height: usize,
    /// Camera from map.
    motion: Motion,
    front: Vec<u32>,
}

/// What a camera sees of the map, to align to.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    pub surfels: &'a [Surfel],
    pub sight: &'a Sight<'a>,
    /// Neighbours farther than this do not count, m.
    pub gate_m: f32,
}

enum Same {
    Piece(usize),
    /// New ground.
    Nothing,
    /// Neither the same surface nor free of doubt: leave it.
    Conflict,
}

impl Sight<'_> {
    #[inline]
    fn block(&self, at: &Vector3<f32>) -> Option<usize> {
        block_of(self.camera, self.side_px, [self.width, self.height], at)
    }

    fn same(&self, surfels: &[Surfel], p: &Point, width_m: f32) -> Same {
        let at = self.motion.moved(&p.at);
        let Some(block) = self.block(&at) else { return Same::Nothing };
        let mut best: Option<(f32, usize)> = None;
        for neighbour in around(block, self.width, self.height) {
            let i = self.front[neighbour];
            let Some(surfel) = surfels.get(i as usize) else { continue };
            let off = p.at - surfel.point.at;
            let across = off.dot(&surfel.point.normal);
            let along = (off.norm_squared() - across * across).max(0.0).sqrt();
            let limit = SIGMAS * both(p.across, surfel.point.across) + POSE_M;
            if across.abs() < limit
                && along < SAME_PLACE * width_m
                && p.normal.dot(&surfel.point.normal) > SAME_NORMAL
                && best.is_none_or(|(least, _)| along < least)
            {
                best = Some((along, i as usize));
            }
        }
        match best {
            Some((_, i)) => Same::Piece(i),
            None => self.free(surfels, p, block),
        }
    }

    /// Where the map has a sure surface a little before or behind, a point is a mistake.
    fn free(&self, surfels: &[Surfel], p: &Point, block: usize) -> Same {
        let Some(surfel) = surfels.get(self.front[block] as usize) else { return Same::Nothing };
        let across = (p.at - surfel.point.at).dot(&surfel.point.normal).abs();
        let limit = SIGMAS * both(p.across, surfel.point.across) + POSE_M;
        if across < 2.0 * limit && surfel.seen > CONFIRMED { Same::Conflict } else { Same::Nothing }
    }
}

/// A block and its eight neighbours.
fn around(block: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (u, v) = (block % width, block / width);
    let rows = v.saturating_sub(1)..=(v + 1).min(height - 1);
    rows.flat_map(move |row| {
        let columns = u.saturating_sub(1)..=(u + 1).min(width - 1);
        columns.map(move |column| row * width + column)
    })
}

impl Target for Seen<'_> {
    type Memory = ();

    #[inline]
    fn find(&self, p: &Vector3<f32>, (): &mut ()) -> Option<&Point> {
        let sight = self.sight;
        let block = sight.block(&sight.motion.moved(p))?;
        let near = |i: u32| {
            let point = &self.surfels.get(i as usize)?.point;
            ((point.at - p).norm_squared() <= self.gate_m * self.gate_m).then_some(point)
        };
        if let Some(point) = near(sight.front[block]) {
            return Some(point);
        }
        let neighbours = around(block, sight.width, sight.height);
        let candidates = neighbours.filter_map(|b| near(sight.front[b]));
        candidates.min_by(|a, b| (a.at - p).norm_squared().total_cmp(&(b.at - p).norm_squared()))
    }
}
