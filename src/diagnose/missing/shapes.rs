//! Shapes that losses may follow: steps in range or tilt, which have names, and nameless curves.

use std::f64::consts::FRAC_PI_2;

use super::cells::Cell;
use super::odds::odds;
use crate::camera::Camera;
use crate::diagnose::views::known::KnownTerms;
use crate::effects::logistic;
use crate::terms::{Axis, Basis, Coordinate, Extent, Modulation, PixelContext, corner_radius};

/// A step beyond whose `middle` a share is lost. A negative width loses what is below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    pub axis: Axis,
    pub middle: f64,
    pub width: f64,
    pub share: f64,
    /// Time of the session from which it is present, s; `None` if throughout.
    pub since_s: Option<f64>,
    /// Whether a step in tilt follows the angle of incidence at each pixel instead of the plane's tilt.
    pub incidence: bool,
}

impl Step {
    pub fn family(&self) -> &'static str {
        if self.axis == Axis::Theta { "grazing-dropout" } else { "range-dropout" }
    }

    /// Step of share 1, present at all times.
    pub fn whole(axis: Axis, middle: f64, width: f64) -> Self {
        Step { axis, middle, width, share: 1.0, since_s: None, incidence: false }
    }

    /// Step with an effect's parameters; the share is 1 where none is given.
    pub fn of(effect: &str, value: impl Fn(&str) -> Option<f64>) -> Option<Self> {
        let step = match effect {
            "grazing-dropout" => Step::whole(
                Axis::Theta,
                value("theta50_deg")?.to_radians(),
                value("width_deg")?.to_radians(),
            ),
            "range-dropout" => Step::whole(Axis::Z, value("z50_m")?, value("width_m")?),
            _ => return None,
        };
        Some(Step { share: value("share").unwrap_or(1.0), ..step })
    }

    /// Steps over distance or tilt that are known already.
    pub fn known(known: &KnownTerms) -> Vec<Self> {
        let of = |id| Step::of(id, |name| known.parameter(id, name));
        ["range-dropout", "grazing-dropout"].into_iter().filter_map(of).collect()
    }

    /// Whether it has not begun yet.
    pub fn before(&self, session_s: f64) -> bool {
        self.since_s.is_some_and(|since| session_s < since)
    }

    /// Cost of choosing among the starts, and of the choice of angle, nats.
    pub fn cost(&self) -> f64 {
        let of_angle = if self.incidence { 2f64.ln() } else { 0.0 };
        of_angle + self.since_s.map_or(0.0, |_| (STARTS as f64).ln())
    }

    pub fn at(&self, p: &PixelContext) -> f64 {
        match self.axis {
            Axis::Theta if self.incidence => incidence(p),
            Axis::Theta => p.theta,
            _ => p.z,
        }
    }

    /// Probability of a loss at `x` on the axis, where `base` is lost anyway.
    pub fn loss(&self, x: f64, base: f64) -> f64 {
        base + (1.0 - base) * self.share * logistic(x - self.middle, self.width)
    }

    /// Log odds that it adds to a cell.
    pub fn adds(&self, c: &Cell<'_>, base: f64) -> f64 {
        let added = || odds(self.loss(self.at(c.place), base)) - odds(base);
        if self.before(c.place.session_s) { 0.0 } else { added() }
    }
}

/// Angle between the line of sight and the target's normal, rad.
fn incidence(p: &PixelContext) -> f64 {
    let ((sin, cos), (down, along)) = (p.theta.sin_cos(), p.azimuth.sin_cos());
    let facing = cos - sin * (along * p.x + down * p.y);
    (facing / (1.0 + p.x * p.x + p.y * p.y).sqrt()).clamp(0.0, 1.0).acos()
}

/// A shape that may explain losses.
#[derive(Debug, Clone)]
pub enum Shape {
    Step(Step),
    Curve(Basis),
}

impl Shape {
    pub fn axis(&self) -> Axis {
        match self {
            Shape::Step(step) => step.axis,
            Shape::Curve(basis) => basis.axis(),
        }
    }

    pub fn family(&self) -> Option<&'static str> {
        match self {
            Shape::Step(step) => Some(step.family()),
            Shape::Curve(_) => None,
        }
    }
}

/// Middles tried for a step, over the axis's reach.
const MIDDLES: usize = 24;
/// Widths tried: in degrees, and as shares of the middle.
const WIDTHS_DEG: [f64; 3] = [1.0, 2.0, 4.0];
const WIDTHS: [f64; 3] = [0.015, 0.03, 0.06];
/// Least reach that shows anything of an axis: rad, and ratio of depths.
const MIN_TILT: f64 = 0.1;
const MIN_RANGE: f64 = 1.1;

/// Steps in range or tilt of these widths and shares.
fn grid(
    reach: &Extent,
    camera: &Camera,
    widths_deg: &[f64],
    widths: &[f64],
    shares: &[f64],
) -> Vec<Step> {
    let mut all = Vec::new();
    let mut add = |step: Step| all.extend(shares.iter().map(|&share| Step { share, ..step }));
    let along = |k: usize| k as f64 / (MIDDLES - 1) as f64;
    if is_told_apart(Axis::Theta, reach) {
        let [low, high] = reach.theta;
        // The corner of the picture sees a plane turned away from it more steeply by its own ray's angle.
        let corner = (corner_radius(camera) / camera.fx).atan();
        for (incidence, steepest) in
            [(false, high + 4f64.to_radians()), (true, (high + corner).min(FRAC_PI_2))]
        {
            for middle in (0..MIDDLES).map(|k| low + along(k) * (steepest - low)) {
                let step = |deg: &f64| Step::whole(Axis::Theta, middle, deg.to_radians());
                widths_deg.iter().for_each(|deg| add(Step { incidence, ..step(deg) }));
            }
        }
    }
    if is_told_apart(Axis::Z, reach) {
        let [low, high] = reach.z;
        for k in 0..MIDDLES {
            let middle = low * (high / low).powf(along(k));
            for width in widths {
                add(Step::whole(Axis::Z, middle, width * middle));
                add(Step::whole(Axis::Z, middle, -width * middle));
            }
        }
    }
    all
}

/// Fewest views on either side of a start.
const SIDE_VIEWS: usize = 3;
/// Most starts tried.
const STARTS: usize = 8;

/// Returns these steps, each begun mid-session, for views at these `times`.
pub fn begun(steps: &[Step], times: impl Iterator<Item = f64>) -> Vec<Step> {
    let mut times: Vec<f64> = times.collect();
    times.sort_by(f64::total_cmp);
    let between = |k: usize| 0.5 * (times[k - 1] + times[k]);
    let last = (times.len() + 1).saturating_sub(SIDE_VIEWS);
    let all: Vec<usize> = (SIDE_VIEWS..last).filter(|&k| times[k] > times[k - 1]).collect();
    let starts = all.iter().step_by(all.len().div_ceil(STARTS).max(1)).map(|&k| between(k));
    let begun = |start| steps.iter().map(move |s| Step { since_s: Some(start), ..*s });
    starts.flat_map(begun).collect()
}

/// Whether views of this reach tell anything of this axis.
pub fn is_told_apart(axis: Axis, reach: &Extent) -> bool {
    let ([flattest, steepest], [near, far]) = (reach.theta, reach.z);
    if axis == Axis::Theta { steepest - flattest > MIN_TILT } else { far > MIN_RANGE * near }
}

/// Nameless curves.
fn curves(camera: &Camera, reach: &Extent) -> Vec<Basis> {
    let (width, height) = (camera.width as f64, camera.height as f64);
    let mut all = Vec::new();
    let mut curve = |over, [low, high]: [f64; 2], nodes| {
        if high > low {
            all.push(Basis::Curve { over, low, high, nodes, times: Modulation::One });
        }
    };
    curve(Coordinate::Radius, [0.0, 1.0], 8);
    curve(Coordinate::Column, [0.0, width], 16);
    curve(Coordinate::Row, [0.0, height], 12);
    curve(Coordinate::Edge, [0.0, 24.0], 5);
    curve(Coordinate::Session, reach.session, 6);
    curve(Coordinate::Z, reach.z, 10);
    curve(Coordinate::Theta, reach.theta, 8);
    if reach.is_unevenly_lit() {
        curve(Coordinate::Light, reach.light, 8);
    }
    all.push(Basis::Map { width, height, across: 8, down: 6, times: Modulation::One });
    all
}

/// All shapes that are tried.
#[derive(Clone)]
pub struct Shapes {
    pub steps: Vec<Step>,
    /// Steps that begin mid-session.
    pub begun: Vec<Step>,
    pub curves: Vec<Basis>,
}

impl Shapes {
    /// Shapes for views at these `times`, s of the session.
    pub fn of(reach: &Extent, camera: &Camera, times: impl Iterator<Item = f64>) -> Self {
        let steps = grid(reach, camera, &WIDTHS_DEG, &WIDTHS, &[1.0, 0.3]);
        // Whole steps (share 1) of the middle width.
        let usual = grid(reach, camera, &WIDTHS_DEG[1..2], &WIDTHS[1..2], &[1.0]);
        Shapes { steps, begun: begun(&usual, times), curves: curves(camera, reach) }
    }

    /// Drops the shapes on this axis.
    pub fn drop_axis(&mut self, axis: Axis) {
        self.steps.retain(|s| s.axis != axis);
        self.begun.retain(|s| s.axis != axis);
        self.curves.retain(|c| c.axis() != axis);
    }
}
