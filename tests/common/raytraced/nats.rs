//! The expected gain of who knows the truth over the model, nats over the whole recording.
//!
//! Counted for one cause alone, from views without noise, after a plane a view is fitted. Noise that
//! neighbours share counts as that of fewer pixels: n over the sum of its correlation for what shows
//! in a mean, over the sum of its square for what shows in a variance or a product.
//!
//! | what acts | gain |
//! |---|---|
//! | error of the mean | frames 1/2 sum (d/sigma)^2, `d` in disparity less its own plane; with reference distances, what the plane took too |
//! | moving board | the same frame by frame, less the view's mean |
//! | spread | 1/2 (r^2 - 1 - ln r^2), `r` the factor on sigma |
//! | loss | Kullback-Leibler of the pixel's rate from the whole recording's, both over a floor of strays |
//! | the rest | [`super::trace`] |

use super::eye::{Eye, World};
use super::geometry::Site;
use super::ground::{Ground, Looked, Sample};
use super::shoot::{Sum, slope};
use super::trace::{
    Trace, of_average, of_effect, of_frozen, of_strays, of_student, of_variance, of_window,
};
use super::{Act, Cause, Clock};

/// Pixels that any sensor loses now and then: a loss is told apart from these.
const STRAYS: f64 = 1e-3;

impl Ground<'_> {
    /// Gain by knowing of `cause`; `None` where no strength makes it weak.
    pub fn nats(&self, cause: &Cause) -> Option<f64> {
        let squares = self.repeats.squares;
        Some(match (&cause.trace, &cause.act) {
            (Trace::Comb, _) => return None,
            (Trace::Field, Act::Ray(_) | Act::Lift(_)) => {
                self.of_mean(&|look| self.bent(look, cause))
            }
            (Trace::Field, Act::Mismatch(_) | Act::Gain(_)) => {
                self.of_mean(&|look| self.shifted(look, cause))
            }
            (Trace::Field, Act::Move(gone)) => self.of_motion(gone),
            (Trace::Field, Act::Spread(_) | Act::Wander(_)) => self.of_spread(cause) / squares,
            (Trace::Field, Act::Loss(_)) => self.of_loss(cause),
            (Trace::Pixels(px), _) => self.of_pixels(*px),
            (Trace::Rows(px), _) => self.of_rows(*px),
            (Trace::Frames(px), _) => self.of_frames(*px),
            (Trace::Average(weights), _) => {
                self.views(|look| of_average(weights, look.plan.stamps.len())) / squares
            }
            (Trace::Frozen(share), _) => {
                self.views(|look| of_frozen(*share, look.plan.stamps.len())) / squares
            }
            (Trace::Window { window, share }, _) => {
                self.views(|look| look.frames() * of_window(window, *share))
            }
            (Trace::Student(nu), _) => self.views(|look| look.frames()) * of_student(*nu),
            (Trace::Stray { fraction, scale }, _) => {
                self.views(|look| look.frames()) * of_strays(*fraction, *scale)
            }
            (Trace::FirstFrame(growth), _) => {
                self.views(|_| of_variance((1.0 + growth).powi(2))) / squares
            }
            (Trace::Field, _) => 0.0,
        })
    }

    /// Gain by knowing that sigma is another's, whose it is at a depth and tilt.
    pub fn nats_of_age(&self, sigma: &dyn Fn(f64, f64) -> f64) -> f64 {
        let one = |look: &Looked<'_>| {
            let gain = |site: &Site| {
                let believed = self.set.described.sigma(site.z, site.theta);
                of_variance((sigma(site.z, site.theta) / believed).powi(2))
            };
            look.frames() * look.sum(|s| gain(&s.site))
        };
        self.weight * self.views.iter().map(one).sum::<f64>() / self.repeats.squares
    }

    /// The sum over views of their pixels on the target times `f`.
    fn views(&self, f: impl Fn(&Looked<'_>) -> f64) -> f64 {
        self.weight * self.views.iter().map(|look| look.sum(|_| 1.0) * f(look)).sum::<f64>()
    }

    /// Error of the disparity that the recording holds, px.
    fn shifted(&self, look: &Looked<'_>, cause: &Cause) -> Vec<f64> {
        let facts = look.plan.facts();
        let one = std::slice::from_ref(cause);
        let at = |site: &Site| {
            let sum = Sum::of(one, site, &facts);
            (site.disparity + sum.error) / sum.gain - site.disparity
        };
        look.on_target().map(|s| at(&s.site)).collect()
    }

    fn bent(&self, look: &Looked<'_>, cause: &Cause) -> Vec<f64> {
        let world = World { causes: std::slice::from_ref(cause), ..self.set.world() };
        let eye = Eye::new(world, look.plan);
        let at = |site: &Site| {
            let there = eye.look(site.u, site.v).filter(|there| there.on_board);
            there.map_or(0.0, |there| there.disparity - site.disparity)
        };
        look.on_target().map(|s| at(&s.site)).collect()
    }

    fn of_mean(&self, delta: &dyn Fn(&Looked<'_>) -> Vec<f64>) -> f64 {
        let unit = &self.set.unit;
        let camera = &unit.sensor.camera;
        let one = |look: &Looked<'_>| {
            let (plane, left) = look.plane([camera.cx, camera.cy], &delta(look));
            let share = look.frames() * self.weight / self.repeats.area;
            0.5 * share * left + self.of_reference(look, plane[0], share)
        };
        self.views.iter().map(one).sum()
    }

    /// What a reference distance tells of a shift of the plane on the axis, px: the tape errs, and
    /// the plane's own depth too.
    fn of_reference(&self, look: &Looked<'_>, shift_px: f64, share: f64) -> f64 {
        let Some(tape_m) = self.set.session.reference_m else { return 0.0 };
        let z = look.plan.stage.board.depth(0.0, 0.0);
        let metres = z * z / self.set.unit.disparity_px_m();
        let told = share * look.sum(|s| s.sigma_px.powi(-2));
        let plane_m = metres / told.max(f64::MIN_POSITIVE).sqrt();
        0.5 * (shift_px * metres).powi(2) / (tape_m * tape_m + plane_m * plane_m)
    }

    fn of_motion(&self, gone: &(dyn Fn(&Clock) -> f64 + Send + Sync)) -> f64 {
        let one = |look: &Looked<'_>| {
            let stamps = &look.plan.stamps;
            let clock = |(frame, stamp): (usize, &f64)| Clock {
                seed: self.set.seed,
                view: look.plan.view,
                frame: frame as i64,
                view_s: stamp - stamps[0],
                width: self.set.unit.sensor.camera.width,
            };
            let way: Vec<f64> = stamps.iter().enumerate().map(|at| gone(&clock(at))).collect();
            let mean = way.iter().sum::<f64>() / look.frames();
            let reach = look.plan.stage.board.reach;
            let moved: f64 = way.iter().map(|g| ((g - mean) / reach).powi(2)).sum();
            // A board nearer by a share has its disparities larger by that share.
            0.5 * moved * look.sum(|s| (s.site.disparity / s.sigma_px).powi(2))
        };
        self.weight * self.views.iter().map(one).sum::<f64>() / self.repeats.area
    }

    fn of_spread(&self, cause: &Cause) -> f64 {
        let fb = self.set.unit.disparity_px_m();
        let one = |look: &Looked<'_>| {
            let facts = look.plan.facts();
            let slope_px = fb * slope(&self.set.unit, look.plan);
            let ratio = |s: &Sample| match &cause.act {
                Act::Wander(px) => 1.0 + (slope_px * px / s.sigma_px).powi(2),
                Act::Spread(f) => f(&s.site, &facts).powi(2),
                _ => 1.0,
            };
            look.frames() * look.sum(|s| of_variance(ratio(s)))
        };
        self.weight * self.views.iter().map(one).sum::<f64>()
    }

    /// A shadow falls beside the board; every other loss counts on it.
    fn of_loss(&self, cause: &Cause) -> f64 {
        let beside = cause.label.axis == "edge-distance";
        let mut rates: Vec<(f64, f64)> = Vec::new();
        for look in &self.views {
            let facts = look.plan.facts();
            let counts = look.samples.iter().filter(|s| beside || s.on_target);
            let rate = |site: &Site| {
                let lost = 1.0 - Sum::of(std::slice::from_ref(cause), site, &facts).answer;
                lost + STRAYS * (1.0 - lost)
            };
            rates.extend(counts.map(|s| (look.frames(), rate(&s.site))));
        }
        let all: f64 = rates.iter().map(|(n, _)| n).sum();
        let mean = rates.iter().map(|(n, p)| n * p).sum::<f64>() / all.max(1.0);
        let told = |p: f64, q: f64| if p > 0.0 { p * (p / q).ln() } else { 0.0 };
        let gain = |p: f64| told(p, mean) + told(1.0 - p, 1.0 - mean);
        self.weight * rates.iter().map(|(n, p)| n * gain(*p)).sum::<f64>()
    }

    /// A pixel's constant is met again in every frame of every view that shows the target there.
    fn of_pixels(&self, px: f64) -> f64 {
        let width = self.set.unit.sensor.camera.width;
        let mut known = std::collections::BTreeMap::<usize, f64>::new();
        for look in &self.views {
            for s in look.on_target() {
                let pixel = s.site.v as usize * width + s.site.u as usize;
                *known.entry(pixel).or_default() += look.frames() * (px / s.sigma_px).powi(2);
            }
        }
        self.weight * known.values().map(|q| of_effect(*q)).sum::<f64>()
    }

    fn of_rows(&self, px: f64) -> f64 {
        let stride = self.weight.sqrt();
        let one = |look: &Looked<'_>| {
            let mut rows = std::collections::BTreeMap::<usize, f64>::new();
            for s in look.on_target() {
                let q = stride * (px / s.sigma_px).powi(2) / self.repeats.row;
                *rows.entry(s.site.v as usize).or_default() += q;
            }
            look.frames() * rows.values().map(|q| of_effect(*q)).sum::<f64>()
        };
        stride * self.views.iter().map(one).sum::<f64>()
    }

    /// The plane of a view takes the mean of its frames.
    fn of_frames(&self, px: f64) -> f64 {
        let one = |look: &Looked<'_>| {
            let q = self.weight * look.sum(|s| (px / s.sigma_px).powi(2)) / self.repeats.area;
            (look.frames() - 1.0) * of_effect(q)
        };
        self.views.iter().map(one).sum()
    }
}
