//! What a camera sees of a room: depth, normals and colour of every pixel.
//!
//! The picture is cut into small tiles; a ray is tested only against bodies whose bounding box overlaps its
//! tile. Colour is Lambertian shading by two ceiling lamps, ambient light reflected by the white walls, and
//! the texture as far as a pixel resolves it.

use nalgebra::{Isometry3, Vector3};

use super::body::{PosedBody, Room, Window, first_met};
use super::shape::Intersection;
use super::texture::{Texture, rough_log2};
use crate::camera::{Camera, Rays};
use crate::scene::Seen;

/// A frame of colour and of true depth.
#[derive(Debug, Clone)]
pub struct Picture {
    pub seen: Seen,
    /// Red, green, blue; row-major.
    pub rgb: Vec<u8>,
}

/// Side of a tile, px.
const TILE: usize = 8;

struct Tile {
    pixels: Vec<usize>,
    window: Window,
}

impl Tile {
    fn new(camera: &Camera, rays: &Rays, (left, top): (usize, usize)) -> Self {
        let (right, bottom) = ((left + TILE).min(camera.width), (top + TILE).min(camera.height));
        let row = |v: usize| (left..right).map(move |u| v * camera.width + u);
        let pixels: Vec<usize> = (top..bottom).flat_map(row).collect();
        // Softened edges sample a third of a pixel beyond the outermost rays.
        let margin = 1.0 / camera.fx.min(camera.fy);
        let mut window = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for (x, y) in pixels.iter().map(|&i| rays.at(i)) {
            for (k, v) in [x, y].into_iter().enumerate() {
                window[0][k] = window[0][k].min(v - margin);
                window[1][k] = window[1][k].max(v + margin);
            }
        }
        Tile { pixels, window }
    }
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
        let corners = (0..camera.height)
            .step_by(TILE)
            .flat_map(|v| (0..camera.width).step_by(TILE).map(move |u| (u, v)));
        let tiles = corners.map(|corner| Tile::new(camera, rays, corner)).collect();
        RoomCamera { room, camera, rays, tiles }
    }

    /// Takes a picture from this pose, on one thread.
    pub fn take(&self, world_from_camera: &Isometry3<f64>) -> Picture {
        let view = View::new(self, world_from_camera);
        let mut picture = self.blank();
        for tile in &self.tiles {
            let bodies = view.bodies_in(tile);
            tile.pixels.iter().for_each(|&i| view.expose(i, &bodies, &mut picture));
        }
        let Picture { seen, rgb } = &mut picture;
        for tile in &self.tiles {
            let edges: Vec<usize> =
                tile.pixels.iter().copied().filter(|&i| is_edge(seen, i)).collect();
            let bodies = if edges.is_empty() { continue } else { view.bodies_in(tile) };
            for i in edges {
                let middle = [0, 1, 2].map(|c| f32::from(rgb[3 * i + c]));
                put(rgb, i, view.softened(i, middle, &bodies));
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
                surface: vec![Seen::NOTHING; pixels],
                albedo: vec![0.0; pixels],
                surfaces: self.room.surfaces(),
                target: None,
            },
            rgb: vec![0; 3 * pixels],
        }
    }

    /// A pixel's ray, scaled to z = 1.
    fn direction(&self, i: usize) -> Vector3<f64> {
        let (x, y) = self.rays.at(i);
        Vector3::new(x, y, 1.0)
    }
}

/// A room as seen from one pose.
struct View<'a> {
    camera: &'a RoomCamera<'a>,
    light: Light,
    /// Bodies that may be visible, nearest first.
    bodies: Vec<(PosedBody<'a>, Window)>,
}

impl<'a> View<'a> {
    fn new(camera: &'a RoomCamera<'a>, world_from_camera: &Isometry3<f64>) -> Self {
        let posed = camera.room.posed(world_from_camera);
        let mut bodies: Vec<_> = posed.filter_map(|p| p.window().map(|w| (p, w))).collect();
        bodies.sort_by(|(a, _), (b, _)| a.nearest.total_cmp(&b.nearest));
        View { camera, light: Light::about(world_from_camera), bodies }
    }

    fn bodies_in(&self, tile: &Tile) -> Vec<&PosedBody<'a>> {
        let [first, last] = tile.window;
        let overlaps =
            |[low, high]: Window| (0..2).all(|k| low[k] <= last[k] && high[k] >= first[k]);
        let near = self.bodies.iter().filter(|(_, window)| overlaps(*window));
        near.map(|(body, _)| body).collect()
    }

    #[inline]
    fn meet<'b>(
        &self,
        direction: &Vector3<f64>,
        bodies: &[&'b PosedBody<'b>],
    ) -> Option<SurfacePoint<'b>> {
        first_met(bodies.iter().copied(), direction)
            .map(|(body, at)| SurfacePoint::new(body, at, direction))
    }

    fn expose(&self, i: usize, bodies: &[&PosedBody<'_>], picture: &mut Picture) {
        let direction = self.camera.direction(i);
        let Some(met) = self.meet(&direction, bodies) else { return };
        let (seen, face) = (&mut picture.seen, met.at.face);
        seen.depth[i] = met.at.t as f32;
        seen.normal[i] = met.normal.cast::<f32>().into();
        seen.surface[i] = met.posed.surface(face);
        seen.albedo[i] = met.posed.body.materials[face].albedo;
        put(&mut picture.rgb, i, self.colour(&met, &direction));
    }

    /// Anti-aliased colour of a pixel on an edge: mean of its middle and of rays beside it.
    fn softened(&self, i: usize, middle: [f32; 3], bodies: &[&PosedBody<'_>]) -> [f32; 3] {
        let Camera { fx, fy, .. } = self.camera.camera;
        let mut sum = middle;
        for [du, dv] in WITHIN_PIXEL {
            let aside = self.camera.direction(i) + Vector3::new(du / fx, dv / fy, 0.0);
            if let Some(met) = self.meet(&aside, bodies) {
                let colour = self.colour(&met, &aside);
                (0..3).for_each(|c| sum[c] += colour[c]);
            }
        }
        sum.map(|c| c / (1 + WITHIN_PIXEL.len()) as f32)
    }

    fn colour(&self, met: &SurfacePoint<'_>, direction: &Vector3<f64>) -> [f32; 3] {
        let RoomCamera { room, camera, .. } = self.camera;
        met.colour(direction, camera.fx, &self.light, &room.textures)
    }
}

/// Sample offsets from the middle, px: with it, three rays in three thirds of the pixel, across and down.
const WITHIN_PIXEL: [[f64; 2]; 2] = [[-0.33, 0.33], [0.33, -0.33]];

fn put(rgb: &mut [u8], i: usize, colour: [f32; 3]) {
    for (channel, value) in rgb[3 * i..3 * i + 3].iter_mut().zip(colour) {
        *channel = (value + 0.5) as u8;
    }
}

/// Whether a neighbour to the right, left, above or below shows another face.
fn is_edge(seen: &Seen, i: usize) -> bool {
    let (u, v) = (i % seen.width, i / seen.width);
    let other = |j: usize| seen.surface[j] != seen.surface[i];
    (u > 0 && other(i - 1))
        || (u + 1 < seen.width && other(i + 1))
        || (v > 0 && other(i - seen.width))
        || (v + 1 < seen.height && other(i + seen.width))
}

struct Lamp {
    at: Vector3<f32>,
    /// Brightness that a point lamp would give a white surface 1 m below it, as a share of display white.
    power: f32,
}

/// Above either long side of the desks, 2.7 m high; together they add about 0.35 on a desk top.
const LAMPS: [Lamp; 2] = [
    Lamp { at: Vector3::new(-0.4, 1.5, 2.7), power: 1.7 },
    Lamp { at: Vector3::new(0.4, -1.5, 2.7), power: 1.7 },
];
/// Light reflected by walls and ceiling on vertical faces, and its gain on faces turned up (or loss on
/// those turned down).
const AMBIENT: f32 = 0.5;
const AMBIENT_SLOPE: f32 = 0.1;
/// Size of a lamp, m: a tube, not a point, so that its light falls off more slowly near by.
const LAMP_SIZE_M: f32 = 1.2;
/// Least cosine of incidence in the choice of a texture level: more grazing surfaces blur no further.
const FLATTEST: f64 = 0.05;
/// Bias of the texture level: imitates a camera's sharpening and keeps corners; half a level does not
/// flicker.
const SHARPEN: f32 = -0.5;

/// The lamps in one camera's frame, so that surface points need no transformation into the room.
pub struct Light {
    lamps: [Lamp; 2],
    up: Vector3<f32>,
}

impl Light {
    pub fn about(room_from_camera: &Isometry3<f64>) -> Self {
        let camera_from_room = room_from_camera.inverse().cast::<f32>();
        let lamps = LAMPS.map(|lamp| Lamp {
            at: camera_from_room.transform_point(&lamp.at.into()).coords,
            power: lamp.power,
        });
        Light { lamps, up: camera_from_room * Vector3::z() }
    }

    /// Brightness of a white surface at a point (m) with this unit normal, both in the camera's frame, as a
    /// share of display white; may exceed one near a lamp.
    #[inline]
    fn on(&self, point: &Vector3<f32>, normal: &Vector3<f32>) -> f32 {
        let direct = self.lamps.iter().map(|lamp| {
            let way = lamp.at - point;
            let square = way.norm_squared();
            let cosine = normal.dot(&way).max(0.0);
            lamp.power * cosine / (square.sqrt() * (square + LAMP_SIZE_M * LAMP_SIZE_M))
        });
        AMBIENT + AMBIENT_SLOPE * normal.dot(&self.up) + direct.sum::<f32>()
    }
}

/// Where a ray hit a surface.
pub struct SurfacePoint<'a> {
    pub posed: &'a PosedBody<'a>,
    pub at: Intersection,
    /// In the body's frame, m.
    point: Vector3<f64>,
    /// In the camera's frame.
    pub normal: Vector3<f64>,
}

impl<'a> SurfacePoint<'a> {
    #[inline]
    pub fn new(posed: &'a PosedBody<'a>, at: Intersection, direction: &Vector3<f64>) -> Self {
        let point = posed.point(direction, at.t);
        SurfacePoint { posed, at, point, normal: posed.normal(&point, at.face) }
    }

    /// Red, green, blue, 0 to 255, seen along `direction` by a camera of this focal length, px.
    pub fn colour(
        &self,
        direction: &Vector3<f64>,
        focal_px: f64,
        light: &Light,
        textures: &[Texture],
    ) -> [f32; 3] {
        let Intersection { t, face } = self.at;
        let body = self.posed.body;
        let material = &body.materials[face];
        let place = body.shape.face_place(&self.point, face).cast::<f32>();
        let size = body.shape.face_size(face).cast::<f32>();
        let (uv, density) = material.coordinates(place.into(), size.into());
        let texture = &textures[material.texture];
        // A pixel covers (t / f)^2 / cos m^2. The level is half the logarithm of its area in texels.
        let tilt = (self.normal.dot(direction).abs() / direction.norm()).max(FLATTEST);
        let side_m = t / focal_px;
        let side_texels = texture.size() as f32;
        let texels = (side_m * side_m / tilt) as f32 * density * side_texels * side_texels;
        let lod = 0.5 * rough_log2(texels) + SHARPEN;
        let light = light.on(&(direction * t).cast::<f32>(), &self.normal.cast());
        let light = light + material.emission * (1.0 - light);
        let printed = texture.at(uv, lod);
        std::array::from_fn(|c| printed[c] * material.tint[c] * light)
    }
}
