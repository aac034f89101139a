//! The office as described by office.json: two desks back to back in the middle of a furnished room.
//!
//! The file lists materials, pieces of furniture made of parts, and areas that hold pieces and single
//! parts; metres and degrees. A piece has its origin at its base, z up, its user or the room at -y; a
//! wall's area has x along the wall and the room at -y. A part's position is the middle of its bottom; its
//! form is a cuboid or shell of this size, a drum of radius and height, or a ball of this radius. A
//! material that the file does not list is the texture of that name, once over the face.

use std::collections::HashMap;

use nalgebra::{Isometry3, Vector3};
use serde::Deserialize;

use super::body::{Body, Room};
use super::shape::Shape;
use super::texture::{MATT, Mapping, Material};
use super::textures;
use crate::rng::Seed;

/// Side of the square floor, m: a path of freiburg2_desk's size (4.2 m across) leaves a metre to
/// the shelves on every side.
pub const FLOOR_M: f64 = 7.2;
/// Height of the room, m.
pub const CEILING_M: f64 = 2.8;

#[derive(Deserialize, Default)]
struct Scene {
    materials: HashMap<String, Look>,
    pieces: HashMap<String, Vec<Part>>,
    areas: Vec<Area>,
}

/// A [`Material`] in the file.
#[derive(Deserialize)]
#[serde(default)]
struct Look {
    texture: String,
    repeat_m: Option<f32>,
    /// Side of a tile, and width of the texture.
    tiles_m: Option<[f32; 2]>,
    tint: [f32; 3],
    emission: f32,
    albedo: f32,
}

impl Default for Look {
    fn default() -> Self {
        let (repeat_m, tiles_m) = (None, None);
        Look {
            texture: String::new(),
            repeat_m,
            tiles_m,
            tint: [1.0; 3],
            emission: 0.0,
            albedo: MATT,
        }
    }
}

/// A desk, a wall or a chair.
#[derive(Deserialize)]
struct Area {
    at: [f64; 3],
    turn_deg: f64,
    things: Vec<Thing>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Thing {
    Piece {
        piece: String,
        at: [f64; 3],
        #[serde(default)]
        turn_deg: f64,
    },
    Part(Part),
}

#[derive(Deserialize)]
struct Part {
    #[serde(flatten)]
    form: Form,
    at: [f64; 3],
    /// Rotation vector: axis times angle.
    #[serde(default)]
    turn_deg: [f64; 3],
    material: String,
    /// Faces with another material.
    #[serde(default)]
    faces: HashMap<String, String>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Form {
    Cuboid([f64; 3]),
    Ball(f64),
    Drum([f64; 2]),
    Shell([f64; 3]),
}

impl Room {
    /// Builds the office. The seed draws what is printed on things, and moves nothing.
    pub fn office(seed: Seed) -> Room {
        let (names, textures): (Vec<String>, _) = textures::draw(seed).into_iter().unzip();
        Room { bodies: Scene::read().unwrap_or_default().bodies(&names), textures }
    }
}

fn pose(at: [f64; 3], turn_deg: [f64; 3]) -> Isometry3<f64> {
    Isometry3::new(at.into(), Vector3::from(turn_deg.map(f64::to_radians)))
}

impl Scene {
    /// Parses the file, which is compiled in; a test checks that it can be read.
    fn read() -> serde_json::Result<Self> {
        serde_json::from_str(include_str!("office.json"))
    }

    fn bodies(&self, textures: &[String]) -> Vec<Body> {
        let mut bodies = Vec::new();
        for area in &self.areas {
            let room_from_area = pose(area.at, [0.0, 0.0, area.turn_deg]);
            for thing in &area.things {
                let (room_from_piece, parts) = match thing {
                    Thing::Part(part) => (room_from_area, std::slice::from_ref(part)),
                    Thing::Piece { piece, at, turn_deg } => {
                        let parts = self.pieces.get(piece).map_or(&[][..], Vec::as_slice);
                        (room_from_area * pose(*at, [0.0, 0.0, *turn_deg]), parts)
                    }
                };
                bodies.extend(parts.iter().map(|p| self.body(p, &room_from_piece, textures)));
            }
        }
        bodies
    }

    fn body(&self, part: &Part, room_from_piece: &Isometry3<f64>, textures: &[String]) -> Body {
        let half = |size: [f64; 3]| Vector3::from(size.map(|side| 0.5 * side));
        let (shape, rise) = match part.form {
            Form::Cuboid(size) => (Shape::Cuboid(half(size)), 0.5 * size[2]),
            Form::Shell(size) => (Shape::Shell(half(size)), 0.5 * size[2]),
            Form::Ball(radius) => (Shape::Ball(radius), radius),
            Form::Drum([radius, height]) => {
                (Shape::Drum { radius, half_height: 0.5 * height }, 0.5 * height)
            }
        };
        let mut materials = [self.material(&part.material, textures); Shape::FACES];
        for (face, material) in &part.faces {
            if let Some(face) = part.form.face(face) {
                materials[face] = self.material(material, textures);
            }
        }
        let [x, y, z] = part.at;
        let room_from_body = room_from_piece * pose([x, y, z + rise], part.turn_deg);
        Body { shape, room_from_body, materials }
    }

    fn material(&self, name: &str, textures: &[String]) -> Material {
        let index = |name: &str| textures.iter().position(|t| t == name).unwrap_or_default();
        let Some(look) = self.materials.get(name) else {
            return Material::new(index(name), Mapping::Fit);
        };
        let mapping = match (look.repeat_m, look.tiles_m) {
            (Some(metres), _) => Mapping::Repeat(metres),
            (None, Some([side_m, of_m])) => Mapping::Tiles { side_m, of_m },
            (None, None) => Mapping::Fit,
        };
        let Look { tint, emission, albedo, .. } = *look;
        Material { texture: index(&look.texture), mapping, tint, emission, albedo }
    }
}

impl Form {
    /// See [`Shape::FACES`].
    fn face(&self, name: &str) -> Option<usize> {
        let names: &[&str] = match self {
            Form::Drum(_) => &["side", "bottom", "top"],
            _ => &["left", "right", "front", "back", "bottom", "top"],
        };
        names.iter().position(|n| *n == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every name in the file refers to something that exists.
    #[test]
    fn the_file_is_read_whole() {
        let scene = Scene::read().unwrap();
        let textures: Vec<String> = textures::draw(Seed(1)).into_iter().map(|t| t.0).collect();
        assert!(scene.materials.values().all(|look| textures.contains(&look.texture)));
        let single = scene.areas.iter().flat_map(|a| &a.things).filter_map(|thing| match thing {
            Thing::Part(part) => Some(part),
            Thing::Piece { piece, .. } => scene.pieces.get(piece).map(|_| None).expect(piece),
        });
        for part in scene.pieces.values().flatten().chain(single) {
            let known = |m: &String| scene.materials.contains_key(m) || textures.contains(m);
            assert!(known(&part.material) && part.faces.values().all(known), "{}", part.material);
            assert!(part.faces.keys().all(|name| part.form.face(name).is_some()));
        }
        assert_eq!(scene.bodies(&textures).len(), 323);
    }
}
