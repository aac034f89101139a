//! Expected log-likelihood gain of an observer who knows the truth over the model, nats over the
//! whole recording.
//!
//! Computed for one cause alone, from noise-free views, after fitting a plane to each view. Correlated noise
//! counts as that of fewer pixels: n over the sum of its correlation for what shows in a mean, over the sum
//! of its square for what shows in a variance or a product.
//!
//! | what acts | gain |
//! |---|---|
//! | mean error | frames 1/2 sum (d/sigma)^2, `d` less its plane; with references, the plane's part too |
//! | moving board | the same frame by frame, minus the view's mean |
//! | spread | 1/2 (r^2 - 1 - ln r^2), `r` the factor on sigma |
//! | loss | Kullback-Leibler of the pixel's rate from the recording's, both above a floor of strays |
//! | the rest | the cause's own formula, see [`super::worth`] |

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::eye::{Eye, Site, World};
use super::geometry::least_squares;
use super::poses::Plan;
use super::shoot::{Sum, slope};
use super::worth::{of_effect, of_variance};
use super::{Act, Cause, Set, Unit, Worth};

/// Rate of pixels that any sensor loses now and then; a loss must stand out from these.
const STRAYS: f64 = 1e-3;

/// A sampled pixel.
#[derive(Clone, Copy)]
pub struct Sample {
    pub site: Site,
    /// Standard deviation of one frame's disparity with the known causes, px.
    pub sigma_px: f64,
    /// On the board, and inside the target's region by the recording's notes.
    pub on_target: bool,
}

/// One view before anything is concealed.
pub struct Looked<'a> {
    pub eye: Eye<'a>,
    pub samples: Vec<Sample>,
}

/// All views, and the correlation of their noise.
pub struct Ground<'a> {
    pub unit: &'a Unit,
    pub views: Vec<Looked<'a>>,
    /// Number of pixels that one sample stands for.
    pub weight: f64,
    pub repeats: Repeats,
    /// Error of the reference distances, m.
    pub reference_m: Option<f64>,
}

/// Pixels that count as one for a mean, for a mean along a row, and for a variance: sums of the noise's
/// correlation (squared for a variance) over all lags.
#[derive(Debug, Clone, Copy)]
pub struct Repeats {
    pub area: f64,
    pub row: f64,
    pub squares: f64,
}

impl Repeats {
    pub fn of<'a>(causes: impl IntoIterator<Item = &'a Cause>) -> Self {
        let mut all = Repeats { area: 1.0, row: 1.0, squares: 1.0 };
        for (window, share) in causes.into_iter().filter_map(|cause| cause.window.as_ref()) {
            let (side, squares) = (window.side(), window.squares());
            all.area = 1.0 + share * (side * side - 1.0);
            all.row = 1.0 + share * (side - 1.0);
            all.squares = 1.0 + share * share * (squares * squares - 1.0);
        }
        all
    }
}

impl<'a> Looked<'a> {
    fn new(world: World<'a>, plan: &'a Plan, stride: usize) -> Self {
        let (unit, eye) = (world.unit, Eye::new(world, plan));
        let (camera, fb) = (&unit.sensor.camera, unit.disparity_px_m());
        let region = plan.notes.region.as_ref();
        let mut samples = Vec::new();
        for v in (stride / 2..camera.height).step_by(stride) {
            for u in (stride / 2..camera.width).step_by(stride) {
                let (u, v) = (u as f64, v as f64);
                let Some(site) = eye.look(u, v) else { continue };
                let spread = Sum::of(world.causes, &site, plan).spread;
                let sigma_px = spread * unit.sigma(site.z, site.theta) * fb / (site.z * site.z);
                let on_target = site.on_board && region.is_none_or(|r| r.contains(u, v));
                samples.push(Sample { site, sigma_px, on_target });
            }
        }
        Looked { eye, samples }
    }

    pub fn plan(&self) -> &'a Plan {
        self.eye.plan
    }

    pub fn frames(&self) -> f64 {
        self.plan().stamps.len() as f64
    }

    fn on_target(&self) -> impl Iterator<Item = &Sample> {
        self.samples.iter().filter(|s| s.on_target)
    }

    /// Sum over the target's samples.
    pub fn sum(&self, f: impl Fn(&Sample) -> f64) -> f64 {
        self.on_target().map(f).sum()
    }

    /// Disparity error in the recording at the target's samples, px.
    fn errors(&self, cause: &Cause) -> Vec<f64> {
        let one = std::slice::from_ref(cause);
        let eye = self.eye.with(one);
        let error = |site: &Site| match cause.act {
            Act::Ray(_) | Act::Lift(_) => {
                let there = eye.look(site.u, site.v).filter(|there| there.on_board);
                there.map_or(0.0, |there| there.disparity - site.disparity)
            }
            _ => {
                let sum = Sum::of(one, site, self.plan());
                (site.disparity + sum.error) / sum.gain - site.disparity
            }
        };
        self.on_target().map(|s| error(&s.site)).collect()
    }

    /// Weighted least squares of `delta`, px, at the target's samples by 1, u and v about the principal
    /// point: the plane in disparity, and the remaining sum of (delta/sigma)^2.
    fn plane(&self, delta: &[f64]) -> (Vector3<f64>, f64) {
        let c = &self.eye.world.unit.sensor.camera;
        let column =
            |s: &Sample| Vector3::new(1.0, (s.site.u - c.cx) / 100.0, (s.site.v - c.cy) / 100.0);
        let rows = self.on_target().zip(delta).map(|(s, d)| (column(s), *d, s.sigma_px.powi(-2)));
        let plane = least_squares(rows).unwrap_or_default();
        let left = |(s, d): (&Sample, &f64)| ((d - column(s).dot(&plane)) / s.sigma_px).powi(2);
        (plane, self.on_target().zip(delta).map(left).sum())
    }
}

impl<'a> Ground<'a> {
    pub fn of(set: &'a Set) -> Self {
        // Edge effects may show in a few pixels only. Strides are odd, so that even and odd columns are
        // sampled alike.
        let fine = set.causes[set.known_causes..].iter().any(|c| c.label.axis == "edge-distance");
        let stride = match set.unit.sensor.camera.width {
            _ if fine => 1,
            0..=160 => 3,
            161..=320 => 5,
            _ => 9,
        };
        let views = set.plans.iter().map(|plan| Looked::new(set.world(), plan, stride)).collect();
        Ground {
            unit: &set.unit,
            views,
            weight: (stride * stride) as f64,
            repeats: Repeats::of(&set.causes),
            reference_m: set.session.reference_m,
        }
    }

    /// Gain from knowing `cause`; `None` where no strength makes it weak.
    pub fn nats(&self, cause: &Cause) -> Option<f64> {
        Some(match (&cause.worth, &cause.act) {
            (Worth::Never, _) => return None,
            (Worth::Formula(formula), _) => cause.where_it_acts(self, formula),
            (_, Act::Ray(_) | Act::Lift(_) | Act::Mismatch(_) | Act::Gain(_)) => {
                self.of_mean(cause)
            }
            (_, Act::Move(gone)) => cause.where_it_acts(self, |ground| ground.of_motion(gone)),
            (_, Act::Spread(_) | Act::Wander(_)) => self.of_spread(cause) / self.repeats.squares,
            (_, Act::Loss(_)) => self.of_loss(cause),
            _ => 0.0,
        })
    }

    /// Gain from knowing that sigma is no longer what is `believed`.
    pub fn nats_of_age(&self, believed: &Unit, aged: &Unit) -> f64 {
        let gain = |s: &Sample| {
            let Site { z, theta, .. } = s.site;
            of_variance((aged.sigma(z, theta) / believed.sigma(z, theta)).powi(2))
        };
        let one = |look: &Looked<'_>| look.frames() * look.sum(gain);
        self.weight * self.views.iter().map(one).sum::<f64>() / self.repeats.squares
    }

    /// Sum over views of their pixels on the target times `f`.
    pub fn views(&self, f: impl Fn(&Looked<'_>) -> f64) -> f64 {
        self.weight * self.views.iter().map(|look| look.sum(|_| 1.0) * f(look)).sum::<f64>()
    }

    fn of_mean(&self, cause: &Cause) -> f64 {
        let one = |look: &Looked<'_>| {
            let (plane, left) = look.plane(&look.errors(cause));
            let share = look.frames() * self.weight / self.repeats.area;
            0.5 * share * left + self.of_reference(look, plane[0], share)
        };
        self.views.iter().map(one).sum()
    }

    /// Gain from a reference distance about a shift of the plane on the axis, px; the tape and the plane's
    /// own depth both have errors.
    fn of_reference(&self, look: &Looked<'_>, shift_px: f64, share: f64) -> f64 {
        let Some(tape_m) = self.reference_m else { return 0.0 };
        let z = look.plan().stage.board.depth(0.0, 0.0);
        let metres = z * z / self.unit.disparity_px_m();
        let known = share * look.sum(|s| s.sigma_px.powi(-2));
        let plane_m = metres / known.max(f64::MIN_POSITIVE).sqrt();
        0.5 * (shift_px * metres).powi(2) / (tape_m * tape_m + plane_m * plane_m)
    }

    fn of_motion(&self, gone: &(dyn Fn(f64) -> f64 + Send + Sync)) -> f64 {
        let one = |look: &Looked<'_>| {
            let stamps = &look.plan().stamps;
            let way: Vec<f64> = stamps.iter().map(|stamp| gone(stamp - stamps[0])).collect();
            let mean = way.iter().sum::<f64>() / look.frames();
            let reach = look.plan().stage.board.reach;
            let moved: f64 = way.iter().map(|g| ((g - mean) / reach).powi(2)).sum();
            // Moving nearer by a fraction raises the disparities by that fraction.
            0.5 * moved * look.sum(|s| (s.site.disparity / s.sigma_px).powi(2))
        };
        self.weight * self.views.iter().map(one).sum::<f64>() / self.repeats.area
    }

    fn of_spread(&self, cause: &Cause) -> f64 {
        let fb = self.unit.disparity_px_m();
        let one = |look: &Looked<'_>| {
            let slope_px = fb * slope(self.unit, look.plan());
            let ratio = |s: &Sample| match &cause.act {
                _ if !cause.acts_at(&s.site, look.plan()) => 1.0,
                Act::Wander(px) => 1.0 + (slope_px * px / s.sigma_px).powi(2),
                Act::Spread(f) => f(&s.site, look.plan()).powi(2),
                _ => 1.0,
            };
            look.frames() * look.sum(|s| of_variance(ratio(s)))
        };
        self.weight * self.views.iter().map(one).sum::<f64>()
    }

    /// Shadows fall beside the board, so all samples count; any other loss counts on the target only.
    fn of_loss(&self, cause: &Cause) -> f64 {
        let beside = cause.label.axis == "edge-distance";
        let rate = |site: &Site, plan: &Plan| {
            let lost = 1.0 - Sum::of(std::slice::from_ref(cause), site, plan).answer;
            lost + STRAYS * (1.0 - lost)
        };
        let mut rates: Vec<(f64, f64)> = Vec::new();
        for look in &self.views {
            let counts = look.samples.iter().filter(|s| beside || s.on_target);
            rates.extend(counts.map(|s| (look.frames(), rate(&s.site, look.plan()))));
        }
        let all: f64 = rates.iter().map(|(n, _)| n).sum();
        let mean = rates.iter().map(|(n, p)| n * p).sum::<f64>() / all.max(1.0);
        let term = |p: f64, q: f64| if p > 0.0 { p * (p / q).ln() } else { 0.0 };
        let gain = |p: f64| term(p, mean) + term(1.0 - p, 1.0 - mean);
        self.weight * rates.iter().map(|(n, p)| n * gain(*p)).sum::<f64>()
    }

    /// A constant of this size in each pixel, seen again in every frame of every view that shows the
    /// target there.
    pub fn of_pixels(&self, px: f64) -> f64 {
        let width = self.unit.sensor.camera.width;
        let mut known = BTreeMap::<usize, f64>::new();
        for look in &self.views {
            for s in look.on_target() {
                let pixel = s.site.v as usize * width + s.site.u as usize;
                *known.entry(pixel).or_default() += look.frames() * (px / s.sigma_px).powi(2);
            }
        }
        self.weight * known.values().map(|q| of_effect(*q)).sum::<f64>()
    }

    /// A shift of this size in each row, fresh in every frame.
    pub fn of_rows(&self, px: f64) -> f64 {
        let stride = self.weight.sqrt();
        let one = |look: &Looked<'_>| {
            let mut rows = BTreeMap::<usize, f64>::new();
            for s in look.on_target() {
                let q = stride * (px / s.sigma_px).powi(2) / self.repeats.row;
                *rows.entry(s.site.v as usize).or_default() += q;
            }
            look.frames() * rows.values().map(|q| of_effect(*q)).sum::<f64>()
        };
        stride * self.views.iter().map(one).sum::<f64>()
    }

    /// A shift of this size in each frame; the plane of a view absorbs the mean of its frames.
    pub fn of_frames(&self, px: f64) -> f64 {
        let one = |look: &Looked<'_>| {
            let q = self.weight * look.sum(|s| (px / s.sigma_px).powi(2)) / self.repeats.area;
            (look.frames() - 1.0) * of_effect(q)
        };
        self.views.iter().map(one).sum()
    }
}
