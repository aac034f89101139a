//! What a camera sees of a room: depth, normals and colour of every pixel.
//!
//! Rays of a small tile of the picture go nearly the same way: bodies are sorted out first for
//! large tiles, then for the small ones in each (cone against sphere, and against the body grown by
//! the cone's width), and a ray meets only the few that are left.

use nalgebra::{Isometry3, Vector3};

use super::body::Staged;
use super::light::Light;
use super::shape::Touch;
use super::texture::rough_log2;
use super::tiles::{Region, Tile, direction};
use super::{Room, surface};
use crate::camera::{Camera, Rays};
use crate::scene::{Nothing, Seen, World};

/// A frame of colour and of true depth.
#[derive(Debug, Clone)]
pub struct Picture {
    pub seen: Seen,
    /// Red, green, blue; row-major.
    pub rgb: Vec<u8>,
}

/// A camera that may stand anywhere in a room.
pub struct RoomCamera<'a> {
    room: &'a Room,
    camera: &'a Camera,
    rays: &'a Rays,
    regions: Vec<Region>,
}

impl<'a> RoomCamera<'a> {
    pub fn new(room: &'a Room, camera: &'a Camera, rays: &'a Rays) -> Self {
        RoomCamera { room, camera, rays, regions: Region::all(camera, rays) }
    }

    /// From this pose; on one thread.
    pub fn take(&self, world_from_camera: &Isometry3<f64>) -> Picture {
        let view = View::new(self, world_from_camera);
        let mut picture = self.blank();
        self.each_tile(&view, |pixels, candidates| {
            pixels.for_each(|i| view.expose(i, candidates, &mut picture));
        });
        let Picture { seen, rgb } = &mut picture;
        self.each_tile(&view, |pixels, candidates| {
            let edges = pixels.filter(|&i| is_edge(seen, i));
            edges.for_each(|i| {
                let middle = [0, 1, 2].map(|c| f32::from(rgb[3 * i + c]));
                put(rgb, i, view.softened(i, middle, candidates));
            });
        });
        picture
    }

    /// The pixels of every small tile, with the bodies they may see, nearest first.
    fn each_tile(
        &self,
        view: &View<'_>,
        mut visit: impl FnMut(&mut dyn Iterator<Item = usize>, &[Candidate]),
    ) {
        let all: Vec<usize> = (0..self.room.bodies.len()).collect();
        for region in &self.regions {
            let near = view.met(&region.tile, &all);
            for tile in &region.parts {
                let candidates = view.sorted(&view.met(tile, &near));
                visit(&mut tile.patch.pixels(self.camera.width), &candidates);
            }
        }
    }

    fn blank(&self) -> Picture {
        let pixels = self.camera.pixels();
        Picture {
            seen: Seen {
                width: self.camera.width,
                height: self.camera.height,
                depth: vec![f32::NAN; pixels],
                normal: vec![[0.0; 3]; pixels],
                surface: vec![Nothing::SURFACE; pixels],
                albedo: vec![0.0; pixels],
                surfaces: self.room.surfaces(),
                target: None,
            },
            rgb: vec![0; 3 * pixels],
        }
    }
}

/// A body that a tile may see, by its nearest possible distance, m.
type Candidate = (f64, usize);

/// A room as seen from one pose.
struct View<'a> {
    camera: &'a RoomCamera<'a>,
    light: Light,
    staged: Vec<Staged>,
}

/// Where a ray ended.
struct Meeting {
    body: usize,
    touch: Touch,
    /// In the body's frame, m.
    point: Vector3<f64>,
    /// In the camera's frame.
    normal: Vector3<f64>,
}

impl<'a> View<'a> {
    fn new(camera: &'a RoomCamera<'a>, world_from_camera: &Isometry3<f64>) -> Self {
        View {
            camera,
            light: Light::about(world_from_camera),
            staged: camera.room.bodies.iter().map(|b| Staged::new(b, world_from_camera)).collect(),
        }
    }

    /// Those of the bodies that a tile may see.
    fn met(&self, tile: &Tile, bodies: &[usize]) -> Vec<usize> {
        bodies.iter().copied().filter(|&index| tile.meets(&self.staged[index])).collect()
    }

    /// Nearest first.
    fn sorted(&self, bodies: &[usize]) -> Vec<Candidate> {
        let near = |&index: &usize| (self.staged[index].nearest(), index);
        let mut candidates: Vec<Candidate> = bodies.iter().map(near).collect();
        candidates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        candidates
    }

    #[inline]
    fn meet(&self, direction: &Vector3<f64>, candidates: &[Candidate]) -> Option<Meeting> {
        let length = direction.norm();
        let mut best: Option<(usize, Touch)> = None;
        for &(nearest, index) in candidates {
            let reached = best.map_or(f64::INFINITY, |(_, touch)| touch.t);
            if nearest > reached * length {
                break;
            }
            if let Some(touch) = self.staged[index].touch(direction)
                && touch.t < reached
            {
                best = Some((index, touch));
            }
        }
        let (body, touch) = best?;
        let point = self.staged[body].point(direction, touch.t);
        let normal = self.staged[body].normal(&point, touch.face);
        Some(Meeting { body, touch, point, normal })
    }

    fn expose(&self, i: usize, candidates: &[Candidate], picture: &mut Picture) {
        let direction = direction(self.camera.rays, i);
        let Some(met) = self.meet(&direction, candidates) else { return };
        let seen = &mut picture.seen;
        seen.depth[i] = met.touch.t as f32;
        seen.normal[i] = met.normal.cast::<f32>().into();
        seen.surface[i] = surface(met.body, met.touch.face);
        seen.albedo[i] = self.camera.room.bodies[met.body].paint(met.touch.face).infrared;
        put(&mut picture.rgb, i, self.colour(&met, &direction));
    }

    /// Mean of the pixel's middle and of rays beside it, where several bodies share the pixel.
    fn softened(&self, i: usize, middle: [f32; 3], candidates: &[Candidate]) -> [f32; 3] {
        let Camera { fx, fy, .. } = self.camera.camera;
        let mut sum = middle;
        for [du, dv] in WITHIN_PIXEL {
            let aside = direction(self.camera.rays, i) + Vector3::new(du / fx, dv / fy, 0.0);
            if let Some(met) = self.meet(&aside, candidates) {
                let colour = self.colour(&met, &aside);
                (0..3).for_each(|c| sum[c] += colour[c]);
            }
        }
        sum.map(|c| c / (1 + WITHIN_PIXEL.len()) as f32)
    }

    /// Red, green, blue, 0 to 255.
    fn colour(&self, met: &Meeting, direction: &Vector3<f64>) -> [f32; 3] {
        let body = &self.camera.room.bodies[met.body];
        let paint = body.paint(met.touch.face);
        let place = body.shape.place(&met.point, met.touch.face);
        let extent = body.shape.extent(met.touch.face);
        let (uv, density) =
            paint.coordinates(place.cast::<f32>().into(), extent.cast::<f32>().into());
        let texture = &self.camera.room.textures[paint.texture];
        // A pixel covers (t / f)^2 / cos: half the logarithm of its area in texels.
        let tilt = (met.normal.dot(direction).abs() / direction.norm()).max(FLATTEST);
        let side_m = met.touch.t / self.camera.camera.fx;
        let size = texture.size() as f32;
        let texels = (side_m * side_m / tilt) as f32 * density * size * size;
        let lod = 0.5 * rough_log2(texels) + SHARPEN;
        let point = (direction * met.touch.t).cast::<f32>();
        let light = self.light.on(&point, &met.normal.cast());
        let light = light + paint.glow * (1.0 - light);
        let printed = texture.at(uv, lod);
        std::array::from_fn(|c| printed[c] * paint.tint[c] * light)
    }
}

/// Beside the middle, px: with it, three rays in three thirds of the pixel, across and down.
const WITHIN_PIXEL: [[f64; 2]; 2] = [[-0.33, 0.33], [0.33, -0.33]];
/// Cosine below which a grazing surface blurs no further.
const FLATTEST: f64 = 0.05;
/// Levels: a camera's own sharpening, and corners stay corners. Half a level does not flicker.
const SHARPEN: f32 = -0.5;

fn put(rgb: &mut [u8], i: usize, colour: [f32; 3]) {
    for (channel, value) in rgb[3 * i..3 * i + 3].iter_mut().zip(colour) {
        *channel = (value + 0.5) as u8;
    }
}

/// Does a neighbour to the right, left, above or below show another face?
fn is_edge(seen: &Seen, i: usize) -> bool {
    let (u, v) = (i % seen.width, i / seen.width);
    let other = |j: usize| seen.surface[j] != seen.surface[i];
    (u > 0 && other(i - 1))
        || (u + 1 < seen.width && other(i + 1))
        || (v > 0 && other(i - seen.width))
        || (v + 1 < seen.height && other(i + seen.width))
}
