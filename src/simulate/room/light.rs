//! Lambert's law under two ceiling lamps, and what the white walls give back from everywhere.

use nalgebra::{Isometry3, Vector3};

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

/// The lamps as one camera has them about itself: what is seen needs no turning into the room.
pub struct Light {
    lamps: [Lamp; 2],
    up: Vector3<f32>,
}

impl Light {
    pub fn about(world_from_camera: &Isometry3<f64>) -> Self {
        let camera_from_world = world_from_camera.inverse().cast::<f32>();
        let lamps = LAMPS.map(|lamp| Lamp {
            at: camera_from_world.transform_point(&lamp.at.into()).coords,
            power: lamp.power,
        });
        Light { lamps, up: camera_from_world * Vector3::z() }
    }

    /// Share of display white that a white surface shows at a point (m), with this unit normal,
    /// both in the camera's frame; may exceed one near a lamp.
    #[inline]
    pub fn on(&self, point: &Vector3<f32>, normal: &Vector3<f32>) -> f32 {
        let direct = self.lamps.iter().map(|lamp| {
            let way = lamp.at - point;
            let square = way.norm_squared();
            let cosine = normal.dot(&way).max(0.0);
            lamp.power * cosine / (square.sqrt() * (square + LAMP_SIZE_M * LAMP_SIZE_M))
        });
        AMBIENT + AMBIENT_SLOPE * normal.dot(&self.up) + direct.sum::<f32>()
    }
}
