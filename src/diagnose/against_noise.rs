//! Against a simulated recording: the size of the noise that stands still within a view, of the noise that
//! changes from frame to frame, and of the light that both come with.
//!
//! The total hides causes from one another. Laser speckle stands still as long as the scene does, read and
//! shot noise change, a larger window averages both alike, and a target that moves turns what stood
//! still into what changes. The views are the sample of each.

use nalgebra::{DMatrix, DVector};
use serde_json::Map;

use super::against::Baseline;
use super::field::Field;
use super::frame_means::velocity;
use super::in_time::{later, of_any_two};
use super::structure::Structure;
use super::texture_finding::{TextureFinding, ViewMean, nats, one};
use crate::solve::fit_by_svd;
use crate::stats::range;
use crate::terms::{Axis, ROOM_LUX, Statistic};

/// That the noise differs is known by then: a sign of why need be no surer than this.
pub const NAMED_LEVEL: f64 = 0.05;
/// A part of the noise below this share is lost in the other.
const MIN_PART: f64 = 0.005;

/// What a view's noise is beside the simulated one's.
struct View {
    /// Variance over the simulated one's, natural logarithms.
    still: f64,
    changing: f64,
    /// Variance over the simulated one's, less one.
    total: f64,
    /// How much the correlation of two frames falls with the time between them.
    falls: f64,
    /// Of this view's variance, what stands still.
    share: f64,
    pixels: f64,
}

impl View {
    fn of(real: &Structure, twin: &Structure) -> Option<Self> {
        let parts = |s: &Structure| {
            let still = of_any_two(s).filter(|c| (MIN_PART..1.0 - MIN_PART).contains(c))?;
            Some([still * s.variance_px2, (1.0 - still) * s.variance_px2])
        };
        let (ours, theirs) = (parts(real)?, parts(twin)?);
        Some(View {
            still: (ours[0] / theirs[0]).ln(),
            changing: (ours[1] / theirs[1]).ln(),
            total: real.variance_px2 / twin.variance_px2 - 1.0,
            falls: real.lagged[0]? - later(real).unwrap_or(f64::NAN),
            share: of_any_two(real)?,
            pixels: real.pixels,
        })
    }
}

/// Which way each part of the noise differs from the simulated one's, if it does.
pub struct NoiseParts {
    views: Vec<View>,
    still: ViewMean,
    changing: ViewMean,
    /// What stands still less what changes.
    apart: ViewMean,
    level: f64,
}

impl NoiseParts {
    fn of(real: &[Structure], twins: &[Structure], level: f64) -> Option<Self> {
        let views: Vec<View> = real.iter().zip(twins).filter_map(|(r, t)| View::of(r, t)).collect();
        let mean = |of: fn(&View) -> f64| mean(&views, of);
        let (still, changing) = (mean(|v| v.still)?, mean(|v| v.changing)?);
        let apart = mean(|v| v.still - v.changing)?;
        Some(NoiseParts { still, changing, apart, views, level })
    }

    fn up(&self, m: &ViewMean) -> bool {
        m.p_above(0.0) < self.level
    }

    fn down(&self, m: &ViewMean) -> bool {
        m.p_below(0.0) < self.level
    }

    /// Less of both by about the same factor: averaged over more pixels.
    pub fn shrink_alike(&self) -> bool {
        let alike = !self.up(&self.apart) && !self.down(&self.apart);
        self.down(&self.still) && self.down(&self.changing) && alike
    }

    /// Root of the share by which the variance differs.
    fn size_sigma(&self) -> f64 {
        mean(&self.views, |v| v.total).map_or(0.0, |m| m.value.abs().sqrt())
    }

    /// Does the still part become the changing one, as where the target moves under the pattern?
    fn renews(&self, velocity_p: f64) -> bool {
        let falls = mean(&self.views, |v| v.falls).map_or(1.0, |m| m.p_above(0.0));
        self.down(&self.still) && self.up(&self.changing) && falls.min(velocity_p) < NAMED_LEVEL
    }

    fn finding(&self, velocity: Option<(f64, f64, f64)>) -> Option<TextureFinding> {
        if self.renews(velocity.map_or(1.0, |v| v.2)) {
            return Some(TextureFinding {
                families: vec!["target-motion"],
                statistic: Statistic::Bias,
                parameters: velocity.map_or_else(Map::new, |v| one("velocity_mps", v.0, v.1)),
                p: self.still.p_below(0.0).max(self.changing.p_above(0.0)),
                nats: nats(&self.still, 0.0) + nats(&self.changing, 0.0),
                ..self.texture(Axis::Frame)
            });
        }
        // Blur and steps make more of both, and more so of what changes.
        if self.up(&self.still) && self.apart.value > 0.0 {
            return Some(TextureFinding {
                families: vec!["frozen-noise"],
                statistic: Statistic::Correlation,
                parameters: mean(&self.views, |v| v.share)
                    .map_or_else(Map::new, |m| one("fraction", m.value, m.std_error)),
                p: self.still.p_above(0.0),
                nats: nats(&self.still, 0.0),
                ..self.texture(Axis::Frame)
            });
        }
        let differs = [&self.still, &self.changing].map(|m| self.up(m) || self.down(m));
        let factor = |m: &ViewMean| (0.5 * m.value).exp();
        let words = format!(
            "the noise that changes from frame to frame is {:.2} times the simulation's, and what stands still {:.2} times",
            factor(&self.changing),
            factor(&self.still)
        );
        differs.contains(&true).then(|| TextureFinding {
            statistic: Statistic::Variance,
            p: [&self.still, &self.changing]
                .map(|m| m.p_above(0.0).min(m.p_below(0.0)))
                .into_iter()
                .fold(1.0, f64::min),
            nats: nats(&self.changing, 0.0).max(nats(&self.still, 0.0)),
            words: Some(words),
            ..self.texture(Axis::Z)
        })
    }

    fn texture(&self, axis: Axis) -> TextureFinding {
        TextureFinding {
            families: Vec::new(),
            statistic: Statistic::Variance,
            axis,
            interval: [0.0, 0.0],
            parameters: Map::new(),
            size_sigma: self.size_sigma(),
            p: 1.0,
            nats: 0.0,
            words: None,
        }
    }
}

fn mean(views: &[View], of: impl Fn(&View) -> f64) -> Option<ViewMean> {
    let values = views.iter().map(|v| (of(v), v.pixels)).filter(|v| v.0.is_finite());
    ViewMean::weighed(&values.collect::<Vec<_>>())
}

impl Baseline {
    /// How the parts of the noise compare; `None` where one of them can hardly be seen.
    pub fn noise_parts(&self, real: &[Structure], level: f64) -> Option<NoiseParts> {
        NoiseParts::of(real, &self.structure, level)
    }

    /// What the parts of the noise, and the infrared images, say.
    pub fn noise_findings(
        &self,
        parts: Option<&NoiseParts>,
        real: &[Structure],
        fields: &[Field],
        level: f64,
    ) -> Vec<TextureFinding> {
        let light = ambient_light(fields, &self.fields, level);
        let reach = range(fields.iter().map(|f| f.plane.depth(0.0, 0.0)));
        // Light of the room is more noise of the image itself.
        let of_light = |f: &TextureFinding| light.is_some() && f.families.is_empty();
        let noise = parts.and_then(|p| p.finding(velocity(real))).filter(|f| !of_light(f));
        let told = noise.map(|found| {
            let interval = if found.axis == Axis::Z { reach } else { found.interval };
            TextureFinding { interval, ..found }
        });
        told.into_iter().chain(light).collect()
    }
}

/// A line through fewer has next to no error to be judged by.
const MIN_LIT_VIEWS: usize = 4;

/// Light of the room: the infrared images are lighter than the simulated ones by a constant, in the darkest
/// view as in the lightest. More or less light of the pattern would be a factor.
fn ambient_light(real: &[Field], twins: &[Field], level: f64) -> Option<TextureFinding> {
    let pairs: Vec<[f64; 2]> = real
        .iter()
        .zip(twins)
        .filter_map(|(r, t)| Some([r.infrared?, t.infrared?]))
        .filter(|[r, t]| *r > 0.0 && *t > 0.0)
        .collect();
    let n = pairs.len();
    if n < MIN_LIT_VIEWS {
        return None;
    }
    let darkest = pairs.iter().map(|p| p[1]).fold(f64::INFINITY, f64::min);
    // Errors are shares of the light. The line's height is that at the darkest view.
    let x = DMatrix::from_fn(n, 2, |i, k| [1.0, pairs[i][1] - darkest][k] / pairs[i][1]);
    let y = DVector::from_fn(n, |i, _| pairs[i][0] / pairs[i][1]);
    let (line, rank) = fit_by_svd(&x, &y)?;
    if rank < 2 {
        return None;
    }
    let left = (&y - &x * &line).norm_squared() / (n - 2) as f64;
    let covariance = (x.transpose() * &x).try_inverse()? * left;
    let views = n as f64 - 1.0;
    let mean = |value: f64, variance: f64| ViewMean { value, std_error: variance.sqrt(), views };
    let lift = mean(line[0] - darkest, covariance[(0, 0)]);
    let at_no_light = mean(
        line[0] - darkest * line[1],
        covariance[(0, 0)] + darkest.powi(2) * covariance[(1, 1)]
            - 2.0 * darkest * covariance[(0, 1)],
    );
    let p = lift.p_above(0.0).max(at_no_light.p_above(0.0));
    if p >= level {
        return None;
    }
    // Over the pattern's on a surface that faces the sensor at 1 m.
    let at_1m = |f: &Field| f.pattern_at_1m().zip(Some(f.ambient_lux.unwrap_or(ROOM_LUX)));
    let ratios = twins
        .iter()
        .filter_map(|f| at_1m(f))
        .map(|(light, lux)| at_no_light.value / light * ROOM_LUX / lux.max(1.0));
    let ratio = crate::stats::mean(ratios)?;
    Some(TextureFinding {
        families: vec!["ambient-light"],
        statistic: Statistic::Variance,
        axis: Axis::Intensity,
        interval: range(pairs.iter().map(|p| p[0])),
        parameters: one("ratio", ratio, ratio * lift.std_error / lift.value),
        size_sigma: 0.0,
        p,
        nats: nats(&lift, 0.0),
        words: None,
    })
}

#[cfg(test)]
#[path = "against_noise_tests.rs"]
mod tests;
