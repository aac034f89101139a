//! The colour of a surface: Lambert's law under two ceiling lamps, what the white walls give back
//! from everywhere, and the texture as far as a pixel resolves it.

use nalgebra::{Isometry3, Vector3};

use super::body::PosedBody;
use super::shape::Intersection;
use super::texture::{Texture, rough_log2};

/// A small lamp.
struct Lamp {
    at: Vector3<f32>,
    /// Brightness it gives a white surface 1 m below it, as a share of display white.
    power: f32,
}

/// Above either long side of the desks, 2.7 m high; together they light a desk top to about 0.7.
const LAMPS: [Lamp; 2] = [
    Lamp { at: Vector3::new(-0.4, 1.5, 2.7), power: 1.7 },
    Lamp { at: Vector3::new(0.4, -1.5, 2.7), power: 1.7 },
];
/// What comes back from walls and ceiling, on faces turned up, and the loss on those turned down.
const AMBIENT: f32 = 0.5;
const AMBIENT_SLOPE: f32 = 0.1;
/// A lamp is a tube, not a point: its light falls off more slowly near by, m.
const LAMP_SIZE_M: f32 = 1.2;
/// Cosine below which a grazing surface blurs no further.
const FLATTEST: f64 = 0.05;
/// Levels: a camera's own sharpening, and corners stay corners. Half a level does not flicker.
const SHARPEN: f32 = -0.5;

/// The lamps as one camera has them about itself: what is seen needs no turning into the room.
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

    /// Share of display white that a white surface shows at a point (m), with this unit normal,
    /// both in the camera's frame; may exceed one near a lamp.
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

/// Where a ray ended.
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
        // A pixel covers (t / f)^2 / cos: half the logarithm of its area in texels.
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
