//! The film's camera: a colour picture and a depth frame of each pose.

use std::collections::HashMap;
use std::ops::Range;

use rayon::prelude::*;

use super::body::PosedRoom;
use super::render::{Picture, RoomCamera};
use super::{Film, Pose};
use crate::camera::Rays;
use crate::effects::{Acting, Instant};
use crate::error::Result;
use crate::frame::{DepthCode, Frame};
use crate::model::SigmaLookup;
use crate::scene::Seen;
use crate::simulate::formula::FormulaSensor;
use crate::simulate::shoot::Physics;
use crate::simulate::speckle::SpeckleSensor;
use crate::view::Sensor;

/// What an effect keeps from frame to frame.
type Memory = HashMap<&'static str, Vec<f32>>;

/// The film's camera, ready to take any frame.
pub struct Shutter<'a> {
    film: &'a Film,
    camera: RoomCamera<'a>,
    depth: DepthCamera<'a>,
}

/// How depth frames are made.
enum DepthCamera<'a> {
    Formula {
        sensor: FormulaSensor<'a>,
        sigma: SigmaLookup,
        memory: Memory,
    },
    /// Its words are converted to `code`.
    Speckle {
        sensor: Box<SpeckleSensor>,
        code: DepthCode,
    },
}

impl<'a> Shutter<'a> {
    /// `sensor` and `rays` describe the same camera; depth words are written in the sensor's code.
    /// Fails as [`SpeckleSensor::new`].
    pub fn new(film: &'a Film, sensor: &'a Sensor, rays: &'a Rays) -> Result<Self> {
        let depth = match &film.physics {
            Physics::Formula { sigma, effects } => DepthCamera::Formula {
                sensor: FormulaSensor { sensor, rays, sigma, effects, seed: film.seed },
                sigma: SigmaLookup::of(sigma),
                memory: Memory::new(),
            },
            Physics::Speckle { causes } => DepthCamera::Speckle {
                // The sensor's words have the code of its read-out; what is written has another.
                sensor: Box::new(SpeckleSensor::new(&film.sensor, causes.clone())?),
                code: sensor.code,
            },
        };
        let camera = RoomCamera::new(&film.room, &sensor.camera, rays);
        Ok(Shutter { film, camera, depth })
    }

    /// Takes consecutive frames; the effects' memory carries over from one to the next.
    pub fn shoot(&mut self, frames: Range<usize>) -> Vec<(Picture, Frame)> {
        let poses = &self.film.poses[frames.clone()];
        let picture = |pose: &Pose| self.camera.take(&pose.world_from_camera);
        let pictures: Vec<Picture> = poses.par_iter().map(picture).collect();
        let since = |frame: usize| self.film.poses[frame].stamp - self.film.poses[0].stamp;
        let instants = frames.map(|frame| {
            let since = since(frame);
            Instant { view: 0, frame, session_s: since, view_s: since }
        });
        let seen: Vec<(Instant, &Picture, &Pose)> =
            instants.zip(&pictures).zip(poses).map(|((i, p), pose)| (i, p, pose)).collect();
        let depths = self.depth.expose(self.film, &seen);
        pictures.into_iter().zip(depths).collect()
    }
}

impl DepthCamera<'_> {
    fn expose(&mut self, film: &Film, seen: &[(Instant, &Picture, &Pose)]) -> Vec<Frame> {
        match self {
            DepthCamera::Formula { sensor, sigma, memory } => {
                let shoot = |(instant, picture, _): &(Instant, &Picture, &Pose),
                             memory: &mut Memory| {
                    let sigma = sigma_of(&picture.seen, sigma);
                    let mut shooting =
                        sensor.begin_at(&picture.seen, sigma, std::mem::take(memory));
                    let shot = shooting.shoot(*instant);
                    *memory = shooting.memory;
                    shot.depth
                };
                // Catalogue effects may have a memory: then frames are taken in order.
                if sensor.effects.iter().all(|a| matches!(a.effect, Acting::Shape(_))) {
                    return seen.par_iter().map(|s| shoot(s, &mut Memory::new())).collect();
                }
                seen.iter().map(|s| shoot(s, memory)).collect()
            }
            DepthCamera::Speckle { sensor, code } => {
                let table = sensor.described().code.table();
                let each = |(instant, _, pose): &(Instant, &Picture, &Pose)| {
                    let room_from_camera = pose.world_from_camera;
                    let room = PosedRoom { room: &film.room, room_from_camera };
                    let Frame { width, height, raw } =
                        sensor.shoot(&room, instant, film.seed).depth;
                    let word = |&raw: &u16| code.raw(f64::from(table.metres(raw)));
                    Frame { width, height, raw: raw.iter().map(word).collect() }
                };
                seen.par_iter().map(each).collect()
            }
        }
    }
}

/// Sigma of every pixel, m; zero where nothing is seen.
fn sigma_of(seen: &Seen, sigma: &SigmaLookup) -> Vec<f32> {
    let of = |(&z, normal): (&f32, &[f32; 3])| {
        let theta = normal[2].abs().min(1.0).acos();
        if z.is_nan() { 0.0 } else { sigma.at(z, theta) }
    };
    seen.depth.iter().zip(&seen.normal).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::{Room, around_the_desks};
    use super::*;
    use crate::effects::Active;
    use crate::model::SigmaModel;
    use crate::rng::Seed;

    /// Depth frames of these poses, a Kinect's 80 x 60 px, with one effect.
    fn depths(poses: Vec<Pose>, effect: &str) -> Vec<Frame> {
        let effects = vec![Active::parse(effect).expect("an effect")];
        let film = Film {
            sensor: Film::kinect(8),
            room: Room::office(Seed(1)),
            poses,
            physics: Physics::Formula { sigma: SigmaModel::paper(), effects },
            seed: Seed(1),
        };
        let rays = film.sensor.camera.rays();
        let frames = 0..film.poses.len();
        let mut shutter = Shutter::new(&film, &film.sensor, &rays).unwrap();
        shutter.shoot(frames).into_iter().map(|(_, depth)| depth).collect()
    }

    /// What an effect derives from the scene follows a moving camera: a later frame has the shadows that
    /// it has as the first one.
    #[test]
    fn a_shadow_is_that_of_the_frame() {
        let poses: Vec<Pose> = around_the_desks().into_iter().step_by(40).take(3).collect();
        let film = depths(poses.clone(), "occlusion-shadow:share=1");
        let shadows = |frame: &Frame| -> Vec<bool> { frame.raw.iter().map(|w| *w == 0).collect() };
        let of_first = shadows(&film[0]);
        assert!(of_first.contains(&true));
        for (frame, pose) in film.iter().zip(&poses).skip(1) {
            let alone = depths(vec![*pose], "occlusion-shadow:share=1");
            assert_eq!(shadows(frame), shadows(&alone[0]));
            assert_ne!(shadows(frame), of_first);
        }
    }
}
