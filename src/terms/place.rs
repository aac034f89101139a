//! Place of a measurement, along every axis that a mismatch may follow.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::stats::range;

/// Cosine of the tilt at which a plane is no longer seen.
pub(super) const FLATTEST: f64 = 0.05;

/// The axes along which a mismatch is located (`crate::docs::catalogue`).
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Axis {
    Z,
    DisparityPhase,
    Column,
    Row,
    Radius,
    /// Place in the image.
    Pixel,
    Theta,
    Azimuth,
    TargetPosition,
    EdgeDistance,
    Intensity,
    /// Time within a view.
    Frame,
    SessionTime,
    Temperature,
    PixelLag,
    Residual,
}

impl Axis {
    /// Description, id and unit.
    const fn names(self) -> [&'static str; 3] {
        match self {
            Axis::Z => ["distance from the sensor", "z", "m"],
            Axis::DisparityPhase => ["phase of the disparity", "disparity-phase", "periods"],
            Axis::Column => ["column of the picture", "column", "px"],
            Axis::Row => ["row of the picture", "row", "px"],
            Axis::Radius => ["distance from the picture's centre", "radius", "px"],
            Axis::Pixel => ["pixel", "pixel", "px"],
            Axis::Theta => ["tilt of the target", "theta", "rad"],
            Axis::Azimuth => ["azimuth of the tilt", "azimuth", "rad"],
            Axis::TargetPosition => ["place on the target", "target-position", "m"],
            Axis::EdgeDistance => ["distance from the target's edge", "edge-distance", "px"],
            Axis::Intensity => ["infrared intensity", "intensity", "of the median"],
            Axis::Frame => ["time within a view", "frame", "s"],
            Axis::SessionTime => ["time since the session began", "session-time", "s"],
            Axis::Temperature => ["temperature", "temperature", "degrees Celsius"],
            Axis::PixelLag => ["distance between two pixels", "pixel-lag", "px"],
            Axis::Residual => ["size of the residual", "residual", "sigma"],
        }
    }

    /// Description, as it follows "the" in a sentence.
    pub fn in_words(self) -> &'static str {
        self.names()[0]
    }

    /// Name in `diagnosis.json`.
    pub fn id(self) -> &'static str {
        self.names()[1]
    }

    /// Unit of its values.
    pub fn unit(self) -> &'static str {
        self.names()[2]
    }
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.id())
    }
}

/// Place of a patch (or a pixel) of a plane.
#[derive(Debug, Clone, Copy, Default)]
pub struct PixelContext {
    /// Column and row of the patch's centre, px.
    pub u: f64,
    pub v: f64,
    /// Side of the patch, px.
    pub side: f64,
    /// Ray of the centre.
    pub x: f64,
    pub y: f64,
    /// Disparity and depth of the plane, px and m.
    pub disparity: f64,
    pub z: f64,
    /// Disparity gradient of the plane along u and v, px per px.
    pub slope: [f64; 2],
    /// Distance from the principal point over that of the farthest corner, 0 to 1.
    pub radius: f64,
    /// Position on the target along its sides: right and down of its centroid, m.
    pub right: f64,
    pub down: f64,
    /// Distance of the plane from the camera, m.
    pub rho: f64,
    /// Distance to the nearest pixel off the target inside the picture, px.
    pub edge: f64,
    /// Tilt and its direction, rad.
    pub theta: f64,
    pub azimuth: f64,
    /// Time since the first view, s.
    pub session_s: f64,
    /// Temperature, degrees Celsius; 0 where unknown.
    pub temperature_c: f64,
    /// Brightness of the surface in infrared over the recording's median; 1 where there is no infrared.
    pub light: f64,
    /// Ambient light, lx; where unknown, 0 in a search and [`ROOM_LUX`] for what a model knows.
    pub ambient: f64,
    /// Model's variance of a pixel's disparity, px^2.
    pub variance: f64,
}

/// Mean of a function over the members of a group.
pub type GroupMean<'a> = dyn Fn(&dyn Fn(usize) -> f64) -> f64 + 'a;

impl PixelContext {
    /// Factor by which the projected pattern's light comes back weaker than from a frontal target at 1 m: with the
    /// square of the range, and with the angle between the pixel's ray and the surface's normal.
    pub fn pattern_fall_off(&self) -> f64 {
        let range = self.z * (1.0 + self.x * self.x + self.y * self.y).sqrt();
        range * range / (self.rho / range).max(FLATTEST)
    }

    /// Moves to the mean of the members' places; what is common to the view stays.
    pub fn average(&mut self, all: &[PixelContext], mean: &GroupMean<'_>) {
        self.u = mean(&|i| all[i].u);
        self.v = mean(&|i| all[i].v);
        self.x = mean(&|i| all[i].x);
        self.y = mean(&|i| all[i].y);
        self.disparity = mean(&|i| all[i].disparity);
        self.z = mean(&|i| all[i].z);
        self.radius = mean(&|i| all[i].radius);
        self.right = mean(&|i| all[i].right);
        self.down = mean(&|i| all[i].down);
        self.edge = mean(&|i| all[i].edge);
        self.light = mean(&|i| all[i].light);
        self.variance = mean(&|i| all[i].variance);
    }
}

/// Distance of the farthest corner from the principal point, px.
pub fn corner_radius(camera: &Camera) -> f64 {
    let (right, bottom) = (camera.width as f64 - 1.0, camera.height as f64 - 1.0);
    [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)]
        .into_iter()
        .map(|(u, v)| f64::hypot(u - camera.cx, v - camera.cy))
        .fold(0.0, f64::max)
}

/// Least and greatest value on each axis.
#[derive(Debug, Clone, Copy, Default)]
pub struct Extent {
    pub column: [f64; 2],
    pub disparity: [f64; 2],
    pub z: [f64; 2],
    pub theta: [f64; 2],
    pub right: [f64; 2],
    pub down: [f64; 2],
    pub session: [f64; 2],
    pub temperature: [f64; 2],
    pub light: [f64; 2],
    pub ambient: [f64; 2],
    /// Greatest distance from an edge, px.
    pub edge: f64,
}

impl Extent {
    pub fn of<'a>(places: impl Iterator<Item = &'a PixelContext> + Clone) -> Self {
        let of = |value: fn(&PixelContext) -> f64| range(places.clone().map(value));
        Extent {
            column: of(|p| p.u),
            disparity: of(|p| p.disparity),
            z: of(|p| p.z),
            theta: of(|p| p.theta),
            right: of(|p| p.right),
            down: of(|p| p.down),
            session: of(|p| p.session_s),
            temperature: of(|p| p.temperature_c),
            light: of(|p| p.light),
            ambient: of(|p| p.ambient),
            edge: of(|p| p.edge)[1],
        }
    }

    /// Whether the light varies enough to show what depends on it.
    pub fn is_unevenly_lit(&self) -> bool {
        self.light[1] > 1.05 * self.light[0]
    }
}
