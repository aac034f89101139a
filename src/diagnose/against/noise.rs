//! Comparison with a simulated recording: the noise that is constant within a view, the noise that changes
//! from frame to frame, and the light that comes with both.
//!
//! The total hides causes from one another. Laser speckle is constant as long as the scene is, read and shot
//! noise change, a larger window averages both alike, and a moving target turns constant noise into changing
//! noise. The views are the sample of each.

use nalgebra::{DMatrix, DVector};
use serde_json::Map;

use super::Baseline;
use crate::diagnose::finding::parameters::one;
use crate::diagnose::noise::frame_means::velocity;
use crate::diagnose::noise::lagged::{later, of_any_two};
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::diagnose::noise::view_mean::{ViewMean, nats};
use crate::diagnose::views::field::Field;
use crate::solve::fit_by_svd;
use crate::stats::{mean as mean_of_all, range};
use crate::terms::{Axis, ROOM_LUX, Statistic};

/// Level for naming a cause: that the noise differs is known by then.
pub const NAMED_LEVEL: f64 = 0.05;
/// Level for naming a motion, by the better of two tests: noise that merely stands still less looks like one.
const MOVING_LEVEL: f64 = 0.01;
/// Smallest share of the constant part's log growth, missing from the changing part, for which constant noise has
/// a cause of its own: 0 for a cause that enlarges both alike, 1 for constant noise alone.
const OF_ITS_OWN: f64 = 0.5;
/// A part of the noise below this share cannot be told from the other.
const MIN_PART: f64 = 0.005;

/// Noise of a view relative to the simulated one's.
struct View {
    /// Log ratios of the variance to the simulated one.
    still: f64,
    changing: f64,
    /// Relative difference from the simulated variance.
    total: f64,
    /// Additional fall of the correlation of two frames with the time between them.
    falls: f64,
    /// Constant share of this view's noise.
    share: f64,
    pixels: f64,
}

impl View {
    fn of(real: &Structure, twin: &Structure) -> Option<Self> {
        let parts = |s: &Structure| {
            let noise_px2 = Some(s.noise_px2()).filter(|px2| *px2 > 0.0)?;
            // What is constant in every view is a pattern of the sensor.
            let fixed = s.still.fixed_px2.unwrap_or(0.0).max(0.0) / noise_px2;
            let all = of_any_two(s).filter(|c| (MIN_PART..1.0 - MIN_PART).contains(c))?;
            let still = Some(all - fixed).filter(|still| *still > MIN_PART)?;
            Some([still * noise_px2, (1.0 - all) * noise_px2])
        };
        let fall = |s: &Structure| Some(s.lagged[0]? - later(s)?);
        let (ours, theirs) = (parts(real)?, parts(twin)?);
        let [still, changing] = [0, 1].map(|k| ours[k] / theirs[k]);
        Some(View {
            still: still.ln(),
            changing: changing.ln(),
            total: real.variance_px2 / twin.variance_px2 - 1.0,
            falls: fall(real).zip(fall(twin)).map_or(f64::NAN, |(r, t)| r - t),
            share: ours[0] / real.noise_px2(),
            pixels: real.pixels,
        })
    }
}

/// Direction in which each part of the noise differs from the simulated one, if it does.
pub struct NoiseParts {
    views: Vec<View>,
    still: ViewMean,
    changing: ViewMean,
    /// By how much more the constant part has grown than the changing one.
    apart: ViewMean,
    level: f64,
}

impl NoiseParts {
    /// `None` where one of the parts can hardly be seen.
    pub fn of(real: &[Structure], twins: &[Structure], level: f64) -> Option<Self> {
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

    /// Whether both parts are smaller by about the same factor: averaged over more pixels.
    pub fn shrink_alike(&self) -> bool {
        let alike = !self.up(&self.apart) && !self.down(&self.apart);
        self.down(&self.still) && self.down(&self.changing) && alike
    }

    /// Root of the relative difference of the variances.
    fn size_sigma(&self) -> f64 {
        mean(&self.views, |v| v.total).map_or(0.0, |m| m.value.abs().sqrt())
    }

    /// Whether constant noise becomes changing noise, as where the target moves under the pattern.
    fn renews(&self, velocity_p: f64) -> bool {
        let falls = mean(&self.views, |v| v.falls).map_or(1.0, |m| m.p_above(0.0));
        let renewed = self.down(&self.still) && self.up(&self.changing);
        renewed && 2.0 * falls.min(velocity_p) < MOVING_LEVEL
    }

    fn finding(&self, velocity: Option<(f64, f64, f64)>) -> Option<TextureFinding> {
        if self.renews(velocity.map_or(1.0, |v| v.2)) {
            return Some(TextureFinding {
                families: vec!["target-motion"],
                statistic: Statistic::Bias,
                parameters: velocity.map_or_else(Map::new, |v| one("velocity_mps", v.0, v.1)),
                p: self.still.p_below(0.0).max(self.changing.p_above(0.0)),
                nats: nats(&self.still, 0.0) + nats(&self.changing, 0.0),
                ..self.texture()
            });
        }
        // Blur increases both parts, the changing one more.
        let of_its_own = self.apart.value > OF_ITS_OWN * self.still.value;
        if self.up(&self.still) && of_its_own && self.apart.p_above(0.0) < NAMED_LEVEL {
            return Some(TextureFinding {
                families: vec!["frozen-noise"],
                statistic: Statistic::Correlation,
                parameters: mean(&self.views, |v| v.share)
                    .map_or_else(Map::new, |m| one("fraction", m.value, m.std_error)),
                p: self.still.p_above(0.0),
                nats: nats(&self.still, 0.0),
                ..self.texture()
            });
        }
        // Two parts, each larger or smaller: four tests.
        let each = [&self.still, &self.changing].map(|m| m.p_above(0.0).min(m.p_below(0.0)));
        let p = 4.0 * each[0].min(each[1]);
        let factor = |m: &ViewMean| (0.5 * m.value).exp();
        let words = format!(
            "the noise that changes from frame to frame is {:.2} times the simulation's, and what stands still {:.2} times",
            factor(&self.changing),
            factor(&self.still)
        );
        (p < self.level).then(|| TextureFinding {
            statistic: Statistic::Variance,
            p,
            nats: nats(&self.changing, 0.0).max(nats(&self.still, 0.0)),
            words: Some(words),
            ..self.texture()
        })
    }

    fn texture(&self) -> TextureFinding {
        TextureFinding {
            size_sigma: self.size_sigma(),
            ..TextureFinding::named(Vec::new(), Statistic::Variance, Axis::Frame)
        }
    }
}

fn mean(views: &[View], of: impl Fn(&View) -> f64) -> Option<ViewMean> {
    let values = views.iter().map(|v| (of(v), v.pixels)).filter(|v| v.0.is_finite());
    ViewMean::weighed(&values.collect::<Vec<_>>())
}

impl Baseline {
    /// Findings from the parts of the noise and from the infrared images.
    pub fn noise_findings(
        &self,
        parts: Option<&NoiseParts>,
        real: &[Structure],
        fields: &[Field],
        level: f64,
    ) -> Vec<TextureFinding> {
        let light = ambient_light(fields, &self.fields, level);
        // Ambient light is additional noise of the image itself.
        let of_light = |f: &TextureFinding| light.is_some() && f.families.is_empty();
        let noise = parts.and_then(|p| p.finding(velocity(real))).filter(|f| !of_light(f));
        noise.into_iter().chain(light).collect()
    }
}

/// Fewest views for a line: with fewer, hardly any residual is left to judge it by.
const MIN_LIT_VIEWS: usize = 4;

/// Line through one recording's light over the other's, one point per view.
struct LightLine {
    /// Its excess over the other's light at the darkest view, and its height where the other has no light.
    lift: ViewMean,
    at_no_light: ViewMean,
    slope: f64,
}

impl LightLine {
    /// Fits pairs [other, one].
    fn of(pairs: &[[f64; 2]]) -> Option<Self> {
        let n = pairs.len();
        if n < MIN_LIT_VIEWS {
            return None;
        }
        let [darkest, _] = range(pairs.iter().map(|p| p[0]));
        // Errors are proportional to the light.
        let x = DMatrix::from_fn(n, 2, |i, k| [1.0, pairs[i][0] - darkest][k] / pairs[i][0]);
        let y = DVector::from_fn(n, |i, _| pairs[i][1] / pairs[i][0]);
        let (line, rank) = fit_by_svd(&x, &y)?;
        if rank < 2 {
            return None;
        }
        let left = (&y - &x * &line).norm_squared() / (n - 2) as f64;
        let covariance = (x.transpose() * &x).try_inverse()? * left;
        let mean = |at: f64, height: f64| {
            let variance =
                covariance[(0, 0)] + at * (at * covariance[(1, 1)] - 2.0 * covariance[(0, 1)]);
            ViewMean::new(height, variance.sqrt(), n as f64 - 1.0)
        };
        Some(LightLine {
            lift: mean(0.0, line[0] - darkest),
            at_no_light: mean(darkest, line[0] - darkest * line[1]),
            slope: line[1],
        })
    }
}

/// Tests for ambient light: the infrared images are lighter than the simulated ones by a constant, in the
/// darkest view as in the lightest. A change of the pattern's light would be a factor. Small differences of
/// the poses flatten either recording's line over the other, so both lines must show it.
fn ambient_light(real: &[Field], twins: &[Field], level: f64) -> Option<TextureFinding> {
    let lit = real.iter().zip(twins).filter_map(|(r, t)| Some([t.infrared?, r.infrared?]));
    let pairs: Vec<[f64; 2]> = lit.filter(|p| p[0] > 0.0 && p[1] > 0.0).collect();
    let swapped: Vec<[f64; 2]> = pairs.iter().map(|p| [p[1], p[0]]).collect();
    let LightLine { lift, at_no_light, slope } = LightLine::of(&pairs)?;
    let other_way = LightLine::of(&swapped)?.at_no_light.p_below(0.0);
    let p = lift.p_above(0.0).max(at_no_light.p_above(0.0)).max(other_way);
    if p >= level || slope <= 0.0 {
        return None;
    }
    // Relative to the pattern on a surface facing the sensor at 1 m, scaled by the lux of the real room.
    let ratios = real.iter().zip(twins).filter_map(|(r, t)| {
        let lux = r.ambient_lux.unwrap_or(ROOM_LUX).max(1.0);
        Some(at_no_light.value / (slope * t.pattern_at_1m()?) * ROOM_LUX / lux)
    });
    let ratio = mean_of_all(ratios)?;
    Some(TextureFinding {
        interval: range(pairs.iter().map(|p| p[1])),
        parameters: one("ratio", ratio, ratio * at_no_light.std_error / at_no_light.value),
        p,
        nats: nats(&lift, 0.0).min(nats(&at_no_light, 0.0)),
        ..TextureFinding::named(vec!["ambient-light"], Statistic::Variance, Axis::Intensity)
    })
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
