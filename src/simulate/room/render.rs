//! What a camera sees of a room: depth, normals and colour of every pixel.
//!
//! Rays of a small tile of the picture go nearly the same way: bodies are sorted out a tile at a
//! time (sphere against cone), and a ray meets only the few that are left.

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::body::Staged;
use super::light::brightness;
use super::shape::Touch;
use super::texture::rough_log2;
use super::{Room, surface};
use crate::camera::{Camera, Rays};
use crate::scene::{Nothing, Seen, World};

/// Pixels a side: a quarter of a desk's width at arm's length, and the fastest of 8, 16 and 32.
const TILE: usize = 16;

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
    tiles: Vec<Tile>,
}

impl<'a> RoomCamera<'a> {
    pub fn new(room: &'a Room, camera: &'a Camera, rays: &'a Rays) -> Self {
        let rows = (0..camera.height).step_by(TILE);
        let corners = rows.flat_map(|v| (0..camera.width).step_by(TILE).map(move |u| (u, v)));
        let tiles = corners.map(|(u, v)| Tile::new(camera, rays, u, v)).collect();
        RoomCamera { room, camera, rays, tiles }
    }

    /// From this pose; on one thread.
    pub fn take(&self, world_from_camera: &Isometry3<f64>) -> Picture {
        let view = View::new(self, world_from_camera);
        let mut picture = self.blank();
        let mut candidates = Vec::with_capacity(self.room.bodies.len());
        for tile in &self.tiles {
            view.sort_out(tile, &mut candidates);
            for i in tile.pixels(self.camera.width) {
                view.expose(i, &candidates, &mut picture);
            }
        }
        for tile in &self.tiles {
            view.sort_out(tile, &mut candidates);
            for i in tile.pixels(self.camera.width) {
                if is_edge(&picture.seen, i) {
                    let colour = view.softened(i, &candidates);
                    put(&mut picture.rgb, i, colour);
                }
            }
        }
        picture
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

/// A patch of the picture and the cone about its rays.
struct Tile {
    first: (usize, usize),
    size: (usize, usize),
    axis: Vector3<f64>,
    cosine: f64,
    sine: f64,
}

impl Tile {
    fn new(camera: &Camera, rays: &Rays, u: usize, v: usize) -> Self {
        let size = (TILE.min(camera.width - u), TILE.min(camera.height - v));
        let mut tile = Tile { first: (u, v), size, axis: Vector3::zeros(), cosine: 1.0, sine: 0.0 };
        let unit = |i: usize| direction(rays, i).normalize();
        tile.axis = tile.pixels(camera.width).map(unit).sum::<Vector3<f64>>().normalize();
        let widest = tile.pixels(camera.width).map(|i| unit(i).dot(&tile.axis));
        let half = widest.fold(1.0, f64::min).min(1.0).acos();
        // The softened edges look half a pixel beyond the outermost rays.
        let half = half + 1.0 / camera.fx.min(camera.fy);
        (tile.sine, tile.cosine) = half.sin_cos();
        tile
    }

    fn pixels(&self, width: usize) -> impl Iterator<Item = usize> + use<> {
        let ((u, v), (columns, rows)) = (self.first, self.size);
        (v..v + rows).flat_map(move |row| (u..u + columns).map(move |column| row * width + column))
    }

    /// May a ray of the cone meet the sphere? Never wrong with a no.
    fn meets(&self, body: &Staged) -> bool {
        let along = self.axis.dot(&body.middle);
        let aside = (body.middle.norm_squared() - along * along).max(0.0).sqrt();
        // Distance of the middle from the cone's side (less than the true one behind the apex).
        aside * self.cosine - along * self.sine <= body.reach
    }
}

fn direction(rays: &Rays, i: usize) -> Vector3<f64> {
    let (x, y) = rays.at(i);
    Vector3::new(x, y, 1.0)
}

/// A body that a tile may see, by its nearest possible distance, m.
type Candidate = (f64, usize);

/// A room as seen from one pose.
struct View<'a> {
    camera: &'a RoomCamera<'a>,
    world_from_camera: Matrix3<f64>,
    position: Vector3<f32>,
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
            world_from_camera: world_from_camera.rotation.to_rotation_matrix().into_inner(),
            position: world_from_camera.translation.vector.cast(),
            staged: camera.room.bodies.iter().map(|b| Staged::new(b, world_from_camera)).collect(),
        }
    }

    /// The bodies the tile may see, nearest first.
    fn sort_out(&self, tile: &Tile, candidates: &mut Vec<Candidate>) {
        candidates.clear();
        let met = self.staged.iter().enumerate().filter(|(_, body)| tile.meets(body));
        candidates.extend(met.map(|(index, body)| (body.nearest(), index)));
        candidates.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
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

    /// Mean of four rays within the pixel, where several bodies share it.
    fn softened(&self, i: usize, candidates: &[Candidate]) -> [f32; 3] {
        let Camera { fx, fy, .. } = self.camera.camera;
        let mut sum = [0.0; 3];
        for [du, dv] in WITHIN_PIXEL {
            let aside = direction(self.camera.rays, i) + Vector3::new(du / fx, dv / fy, 0.0);
            if let Some(met) = self.meet(&aside, candidates) {
                let colour = self.colour(&met, &aside);
                (0..3).for_each(|c| sum[c] += colour[c]);
            }
        }
        sum.map(|c| c / WITHIN_PIXEL.len() as f32)
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
        let way = (self.world_from_camera * direction * met.touch.t).cast::<f32>();
        let normal = (self.world_from_camera * met.normal).cast::<f32>();
        let light = brightness(&(self.position + way), &normal);
        let light = light + paint.glow * (1.0 - light);
        let printed = texture.at(uv, lod);
        std::array::from_fn(|c| printed[c] * paint.tint[c] * light)
    }
}

/// A rotated grid: every row and column of a pixel is tried, px.
const WITHIN_PIXEL: [[f64; 2]; 4] =
    [[-0.125, -0.375], [0.375, -0.125], [0.125, 0.375], [-0.375, 0.125]];
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
