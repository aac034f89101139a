//! Where the board stands, when, and the notes about it.

use nalgebra::Vector3;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::FRAC_PI_2;

use super::Unit;
use super::geometry::{Board, Stage, inside_px};
use super::kernels::scattered;
use kinoise::camera::Camera;
use kinoise::rng::Stream;
use kinoise::view::{Region, TargetSize, ViewNotes};

/// Set-up of a session.
#[derive(Debug, Clone)]
pub struct Session {
    pub views: usize,
    pub frames: usize,
    /// Half the board's size, m; `None` for a wall larger than the picture.
    pub half: Option<[f64; 2]>,
    /// Distance from the board's centre to the wall behind it, m.
    pub gap_m: f64,
    /// Maximum tilt, rad.
    pub steepest: f64,
    pub region: Marked,
    /// Error of the reference distances, m.
    pub reference_m: Option<f64>,
    pub conditions: bool,
}

/// What every view's notes say about the board's region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Marked {
    Nothing,
    Outline,
    Rectangle,
}

/// One view: what causes may depend on besides the pixel.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Its index in the session.
    pub view: usize,
    pub stage: Stage,
    pub stamps: Vec<f64>,
    /// Since the session began, s.
    pub session_s: f64,
    /// Illuminance of the room, lx.
    pub lux: f64,
    pub temperature_c: f64,
    pub notes: ViewNotes,
}

const NEAREST_M: f64 = 0.8;
const FARTHEST_M: f64 = 3.5;
/// Maximum depth of a wall within the image.
const WALL_ENDS_M: f64 = 5.0;
const RATE_HZ: f64 = 30.0;

impl Session {
    /// Half the board's width, m; for a wall, a usual value.
    pub fn half_m(&self) -> f64 {
        self.half.map_or(0.6, |half| half[0])
    }

    /// All views in the order they are taken; distances, tilts and directions are shuffled independently.
    pub fn draw(&self, unit: &Unit, rng: &mut Stream) -> Vec<Plan> {
        let n = self.views;
        let (near, tilt, turn) = (scattered(n, rng), scattered(n, rng), scattered(n, rng));
        let mut clock = rng.random_range(100.0..10_000.0);
        let begin = clock;
        (0..n)
            .map(|i| {
                let z = NEAREST_M * (FARTHEST_M / NEAREST_M).powf(near[i]);
                let azimuth = azimuth(turn[i], rng);
                let theta = self.within(z, self.steepest * tilt[i], azimuth, unit);
                let plan = self.view(unit, z, [theta, azimuth], [clock, clock - begin], rng);
                clock += rng.random_range(60.0..240.0);
                Plan { view: i, ..plan }
            })
            .collect()
    }

    /// The drawn tilt, limited for a wall to what fits in the image; a board can have all of it.
    pub fn within(&self, z: f64, drawn: f64, azimuth: f64, unit: &Unit) -> f64 {
        if self.half.is_some() {
            return drawn;
        }
        drawn.min(wall_tilt(&unit.sensor.camera, z, azimuth, WALL_ENDS_M))
    }

    /// A single view at depth `z` with this tilt; `stamp` is on the recording's clock, `session_s` on
    /// the session's.
    pub fn view(
        &self,
        unit: &Unit,
        z: f64,
        tilt: [f64; 2],
        [stamp, session_s]: [f64; 2],
        rng: &mut Stream,
    ) -> Plan {
        let aim = [rng.random_range(-0.05..0.05), rng.random_range(-0.05..0.05)];
        let mut board = Board::posed(z, tilt, aim, rng.random_range(-0.05..0.05));
        board.half = self.half;
        let behind = board.corners(0.0).map(|corners| {
            let farthest = corners.iter().map(|c| c.z).fold(z, f64::max);
            (z + self.gap_m).max(farthest + 0.1)
        });
        let off: f64 = StandardNormal.sample(rng);
        let lux = (100f64.ln() + rng.random::<f64>() * 20f64.ln()).exp().round();
        let temperature_c = (10.0 * rng.random_range(20.0..32.0f64)).round() / 10.0;
        let notes = ViewNotes {
            target: self.half.map(|[a, b]| TargetSize::of(2.0 * a, 2.0 * b)),
            reference_distance_m: self
                .reference_m
                .map(|error| (1e4 * (z + error * off)).round() / 1e4),
            reference_uncertainty_m: None,
            region: self.region(unit, &board),
            temperature_c: self.conditions.then_some(temperature_c),
            ambient_lux: self.conditions.then_some(lux),
            notes: None,
        };
        let stage = Stage { board, wall: behind, theta: tilt[0], azimuth: tilt[1] };
        let stamps = (0..self.frames).map(|k| stamp + k as f64 / RATE_HZ).collect();
        Plan { view: 0, stage, stamps, session_s, lux, temperature_c, notes }
    }

    fn region(&self, unit: &Unit, board: &Board) -> Option<Region> {
        let outline = outline(unit, &board.corners(0.02)?)?;
        match self.region {
            Marked::Nothing => None,
            Marked::Outline => Some(Region::Polygon(outline.map(|p| p.map(tenth)).to_vec())),
            Marked::Rectangle => Some(Region::Rectangle(rectangle(unit, &outline))),
        }
    }
}

/// Maximum tilt, rad, of a wall that reaches no farther than `ends_m` within the image.
pub fn wall_tilt(c: &Camera, z: f64, azimuth: f64, ends_m: f64) -> f64 {
    // Where the wall leaves the image, uphill: 1/z (1 - tan(theta) reach) = 1/ends_m.
    let reach = 0.5
        * (c.width as f64 / c.fx * azimuth.cos().abs()
            + c.height as f64 / c.fy * azimuth.sin().abs());
    ((1.0 - z / ends_m) / (1.05 * reach)).atan()
}

fn tenth(px: f64) -> f64 {
    (10.0 * px).round() / 10.0
}

/// Azimuth about the image axis that `turn` (0 to 1) chooses: half the time within 0.1 rad of it, otherwise
/// within 45 degrees.
pub fn azimuth(turn: f64, rng: &mut Stream) -> f64 {
    let axis = FRAC_PI_2 * (4.0 * turn).floor();
    let reach = if rng.random::<bool>() { 0.1 } else { std::f64::consts::FRAC_PI_4 };
    axis + rng.random_range(-reach..reach)
}

/// Corners in the image, px; `None` where one is behind the camera or close to it.
pub fn outline(unit: &Unit, corners: &[Vector3<f64>; 4]) -> Option<[[f64; 2]; 4]> {
    let c = &unit.sensor.camera;
    let seen = corners.iter().all(|p| p.z > 0.05);
    seen.then(|| corners.map(|p| [c.cx + c.fx * p.x / p.z, c.cy + c.fy * p.y / p.z]))
}

/// Largest rectangle with the image's aspect ratio about the principal point that lies on the board.
fn rectangle(unit: &Unit, outline: &[[f64; 2]; 4]) -> [f64; 4] {
    let c = &unit.sensor.camera;
    let (width, height) = (c.width as f64 - 1.0, c.height as f64 - 1.0);
    let sized = |share: f64| {
        let (a, b) = (0.5 * share * width, 0.5 * share * height);
        [c.cx - a, c.cy - b, c.cx + a, c.cy + b]
    };
    let fits = |[u0, v0, u1, v1]: [f64; 4]| {
        [(u0, v0), (u1, v0), (u0, v1), (u1, v1)]
            .iter()
            .all(|(u, v)| inside_px(outline, *u, *v) > 0.0)
    };
    let share = (1..=50).rev().map(|k| f64::from(k) / 50.0).find(|s| fits(sized(*s)));
    let [u0, v0, u1, v1] = sized(share.unwrap_or(0.02));
    [u0.max(0.0), v0.max(0.0), u1.min(width), v1.min(height)].map(f64::round)
}
