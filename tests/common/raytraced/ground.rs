//! What is known of a set before anything is concealed, at a sample of its pixels.

use nalgebra::{Matrix3, Vector3};

use super::eye::Eye;
use super::geometry::Site;
use super::poses::Plan;
use super::sets::Set;
use super::shoot::Sum;
use super::{Cause, Trace};

/// A pixel that is looked at.
pub(super) struct Sample {
    pub site: Site,
    /// Standard deviation of a frame's disparity with the known causes, px.
    pub sigma_px: f64,
    /// On the board, and where the recording says that the target is.
    pub on_target: bool,
}

/// One view.
pub(super) struct Looked<'a> {
    pub plan: &'a Plan,
    pub samples: Vec<Sample>,
}

/// All views, and how much the noise of neighbours repeats.
pub(super) struct Ground<'a> {
    pub set: &'a Set,
    pub views: Vec<Looked<'a>>,
    /// Pixels that one sample stands for.
    pub weight: f64,
    /// Pixels that tell of a mean as much as one alone; along a row; and of a variance.
    pub repeats: Repeats,
}

/// Sums of the noise's correlation over all lags.
#[derive(Debug, Clone, Copy)]
pub(super) struct Repeats {
    pub area: f64,
    pub row: f64,
    pub squares: f64,
}

impl Repeats {
    pub fn of<'a>(causes: impl IntoIterator<Item = &'a Cause>) -> Self {
        let mut all = Repeats { area: 1.0, row: 1.0, squares: 1.0 };
        for cause in causes {
            if let Trace::Window { window, share } = &cause.trace {
                let (side, squares) = (window.side(), window.squares());
                all.area = 1.0 + share * (side * side - 1.0);
                all.row = 1.0 + share * (side - 1.0);
                all.squares = 1.0 + share * share * (squares * squares - 1.0);
            }
        }
        all
    }
}

/// Odd, so that even and odd columns are met alike.
fn stride(set: &Set) -> usize {
    // A few pixels at the edges are all there is to see, or what differs lies apart.
    let fine = set.causes[set.known_causes..].iter().any(|c| c.label.axis == "edge-distance");
    match set.unit.sensor.camera.width {
        _ if fine => 1,
        0..=160 => 3,
        161..=320 => 5,
        _ => 9,
    }
}

impl<'a> Ground<'a> {
    pub fn of(set: &'a Set) -> Self {
        let stride = stride(set);
        let views = set.plans.iter().map(|plan| Looked::new(set, plan, stride)).collect();
        let repeats = Repeats::of(&set.causes);
        Ground { set, views, weight: (stride * stride) as f64, repeats }
    }
}

impl<'a> Looked<'a> {
    fn new(set: &Set, plan: &'a Plan, stride: usize) -> Self {
        let world = set.world();
        let camera = &world.unit.sensor.camera;
        let eye = Eye::new(world, plan);
        let facts = plan.facts();
        let fb = world.unit.disparity_px_m();
        let region = plan.notes.region.as_ref();
        let mut samples = Vec::new();
        for v in (stride / 2..camera.height).step_by(stride) {
            for u in (stride / 2..camera.width).step_by(stride) {
                let (u, v) = (u as f64, v as f64);
                let Some(site) = eye.look(u, v) else { continue };
                let spread = Sum::of(world.causes, &site, &facts).spread;
                let sigma_px =
                    spread * world.unit.sigma(site.z, site.theta) * fb / (site.z * site.z);
                let on_target = site.on_board && region.is_none_or(|r| r.contains(u, v));
                samples.push(Sample { site, sigma_px, on_target });
            }
        }
        Looked { plan, samples }
    }

    pub fn frames(&self) -> f64 {
        self.plan.stamps.len() as f64
    }

    pub fn on_target(&self) -> impl Iterator<Item = &Sample> {
        self.samples.iter().filter(|s| s.on_target)
    }

    /// Sum over the target's samples.
    pub fn sum(&self, f: impl Fn(&Sample) -> f64) -> f64 {
        self.on_target().map(f).sum()
    }

    /// Least squares of `delta`, px, at the target's samples by 1, u and v, each over its sigma: the
    /// plane, in disparity about the principal point, and what it leaves of sum (delta/sigma)^2.
    pub fn plane(&self, principal: [f64; 2], delta: &[f64]) -> (Vector3<f64>, f64) {
        let column = |s: &Sample| {
            Vector3::new(1.0, (s.site.u - principal[0]) / 100.0, (s.site.v - principal[1]) / 100.0)
        };
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (s, d) in self.on_target().zip(delta) {
            let (x, w) = (column(s), s.sigma_px.powi(-2));
            normal += x * x.transpose() * w;
            right += x * (w * d);
        }
        let plane = normal.cholesky().map_or(Vector3::zeros(), |c| c.solve(&right));
        let left = |(s, d): (&Sample, &f64)| ((d - column(s).dot(&plane)) / s.sigma_px).powi(2);
        (plane, self.on_target().zip(delta).map(left).sum())
    }
}
