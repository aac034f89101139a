//! How far a recording reaches on every axis.

use super::place::PixelContext;
use crate::stats::range;

/// Least and greatest of each axis.
#[derive(Debug, Clone, Copy, Default)]
pub struct Extent {
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

    /// Does the light differ by enough to see what goes with it?
    pub fn is_unevenly_lit(&self) -> bool {
        self.light[1] > 1.05 * self.light[0]
    }
}
