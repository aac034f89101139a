//! Found terms at every pixel, and typical values of the pixels.

use rayon::prelude::*;

use crate::diagnose::noise::moments::Moments;
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::tail_counts::{TailCounts, places, tail};
use crate::diagnose::noise::texture::moving;
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::diagnose::search::outcome::Outcome;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::known_error::is_beyond;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::light::Light;
use crate::diagnose::views::tiles::{Places, rim_px};
use crate::measure::Workbench;
use crate::model::SigmaModel;
use crate::stats::mean;
use crate::terms::{DISPARITY_UNIT_PX, PixelContext, Pixels, Statistic, Term, disparity_power};

/// Noise correlation between frames of a view, by lag; zero where none was found or is known.
pub(in crate::diagnose) fn common(
    structure: &[Structure],
    textures: &[TextureFinding],
    known: &KnownTerms,
) -> [f64; 3] {
    let in_time = ["frozen-noise", "temporal-correlation"];
    let of_all = textures.iter().filter(|t| t.of_some.is_none());
    let told = of_all.flat_map(|h| &h.families).any(|f| in_time.contains(f))
        || in_time.iter().any(|id| known.has(id));
    if !told {
        return [0.0; 3];
    }
    // The variance between frames lacks what rounding alone makes them share, noise or not.
    let at = |lag: usize| mean(structure.iter().filter_map(|s| Some(s.stored[lag]? - s.rounded)));
    let first = at(0).unwrap_or(0.0);
    let second = at(1).unwrap_or(first);
    [first, second, at(2).unwrap_or(second)]
}

/// Variance of the pixels' constant errors, px^2.
pub(in crate::diagnose) fn fixed_px2(structure: &[Structure]) -> f64 {
    mean_of(structure.iter().filter_map(|s| s.still.fixed_px2))
}

pub(in crate::diagnose) fn mean_of(values: impl Iterator<Item = f64>) -> f64 {
    mean(values).unwrap_or(0.0).max(0.0)
}

pub(in crate::diagnose) fn typical_sigma_px(fields: &[Field]) -> f64 {
    let mut all: Vec<f32> = fields.iter().filter_map(|f| f.middle_sigma_px()).collect();
    f64::from(crate::stats::median_in_place(&mut all))
}

/// Correlation of successive frames below which they count as independent.
const HARDLY_STILL: f64 = 0.1;

/// What the pixels' errors are whitened by: the model's sigma where it says something (`None`: everywhere,
/// when two recordings are compared), and the variance terms found.
pub(in crate::diagnose) struct Whitener<'a> {
    pub sigma: Option<&'a SigmaModel>,
    pub terms: &'a [Term],
    pub survey: &'a Survey,
    pub bench: &'a Workbench<'a>,
}

pub(in crate::diagnose) fn measure_tails(
    structure: &mut [Structure],
    fields: &[Field],
    bias: &[Vec<f32>],
    Whitener { sigma, terms, survey, bench }: &Whitener<'_>,
) {
    let factors = pixel_terms(fields, terms, survey.light, bench);
    structure.par_iter_mut().zip(fields).enumerate().for_each(|(n, (s, field))| {
        // Places where the model says nothing of the noise are excluded, and pixels that may also see what is
        // behind the target.
        let theta = field.plane.theta();
        let rim = rim_px(&bench.sensor.camera) as f32;
        let is_told = |k: usize| {
            let z = field.scale_px_m / field.disparity(k, &bench.rays);
            let told = sigma.is_none_or(|sigma| !is_beyond(sigma, z, theta));
            told && field.edge.get(k).is_none_or(|edge| *edge >= rim)
        };
        let told: Vec<bool> = (0..field.pixels.len()).map(is_told).collect();
        let factor = |k: usize| factors.get(n).map_or(1.0, |f| (0.5 * f[k]).exp());
        let sigma_px: Vec<f32> = (0..told.len()).map(|k| field.sigma[k] * factor(k)).collect();
        // Single frames, unless their constant part could be taken for a tail.
        let apart = s.stored[0].is_some_and(|c| c < HARDLY_STILL);
        let whitened = |frame: &Vec<f32>| {
            let white = |k: usize| {
                let error = frame[k] - bias.get(n).map_or(0.0, |b| b[k]);
                if told[k] { error / sigma_px[k] } else { f32::NAN }
            };
            field.high_passed(&(0..frame.len()).map(white).collect::<Vec<f32>>())
        };
        let mut looks: Vec<Vec<f32>> = field.first.iter().map(whitened).collect();
        if !apart && !looks.is_empty() {
            looks = vec![moving(&looks, s.stored[0])];
        }
        (s.tails, s.moments) = (TailCounts::default(), Moments::default());
        let mut far = vec![false; looks.first().map_or(0, Vec::len)];
        for look in &looks {
            s.tails.add(&tail(look, field.width, &mut far));
            s.moments.add(look, field.width);
        }
        s.far_places = places(far, field.width);
        let disparity = |k| field.disparity(k, &bench.rays) as f32;
        let relative = sigma_px.iter().enumerate().map(|(k, s)| f64::from(s / disparity(k)));
        s.relative_sigma = mean(relative.filter(|s| s.is_finite())).unwrap_or(0.0);
    });
}

/// The chosen terms with the coefficients of their common fit.
pub fn terms_of(outcome: &Outcome, statistic: Statistic) -> Vec<Term> {
    (0..outcome.chosen.len())
        .map(|k| Term {
            statistic,
            basis: outcome.chosen[k].candidate.basis.clone(),
            coefficients: outcome.coefficients(k),
        })
        .collect()
}

pub(in crate::diagnose) fn typical_sigma_mm(fields: &[Field]) -> f64 {
    let of = |f: &Field| {
        let z = f.plane.depth(0.0, 0.0);
        let px = f.middle_sigma_px().map_or(0.0, f64::from);
        1e3 * px * z * z / f.scale_px_m
    };
    let mut all: Vec<f32> = fields.iter().map(|f| of(f) as f32).collect();
    f64::from(crate::stats::median_in_place(&mut all))
}

/// Terms fixed in the picture up to a power of the disparity, tabulated at every pixel for a disparity of
/// [`DISPARITY_UNIT_PX`].
struct Still {
    power: f64,
    values: Vec<f64>,
}

impl Still {
    /// Splits the terms into these, one for each power, and the others.
    fn of(terms: &[Term], bench: &Workbench<'_>) -> (Vec<Self>, Vec<Term>) {
        let mut by_power: Vec<(f64, Vec<Term>)> = Vec::new();
        let mut others = Vec::new();
        for term in terms {
            let Some(power) = term.basis.power_in_picture() else {
                others.push(term.clone());
                continue;
            };
            match by_power.iter_mut().find(|(of, _)| *of == power) {
                Some((_, same)) => same.push(term.clone()),
                None => by_power.push((power, vec![term.clone()])),
            }
        }
        let camera = &bench.sensor.camera;
        let pixels = Pixels::new(camera, &bench.rays, 1.0);
        let still = |(power, terms): (f64, Vec<Term>)| {
            let value = |i: usize| {
                let (side, disparity) = (1.0, DISPARITY_UNIT_PX);
                Term::sum(&terms, &PixelContext { side, disparity, ..pixels.place(i) })
            };
            let all = (0..camera.width * camera.height).into_par_iter();
            Still { power, values: all.map(value).collect() }
        };
        (by_power.into_iter().map(still).collect(), others)
    }

    /// Value at pixel `i` of the picture on a surface of this disparity, px.
    fn at(&self, i: u32, disparity: f64) -> f64 {
        disparity_power(self.power, disparity) * self.values[i as usize]
    }
}

/// Subtracts the `bias` terms from the residuals, and scales sigma by the `variance` terms.
pub(in crate::diagnose) fn subtract_terms(
    fields: &mut [Field],
    [bias, variance]: [&[Term]; 2],
    light: Light,
    bench: &Workbench<'_>,
) {
    let [bias, spread] = [bias, variance].map(|terms| pixel_terms(fields, terms, light, bench));
    for (n, field) in fields.iter_mut().enumerate() {
        bias.get(n).into_iter().for_each(|b| subtract_bias(field, b));
        for (sigma, log) in field.sigma.iter_mut().zip(spread.get(n).into_iter().flatten()) {
            *sigma *= (0.5 * log).exp();
        }
    }
}

/// Subtracts `bias` (px by pixel) from the residuals. Means of whole frames are only compared with one
/// another, and keep what all frames share.
fn subtract_bias(field: &mut Field, bias: &[f32]) {
    let both = field.mean.iter_mut().zip(&mut field.square);
    for ((mean, square), b) in both.zip(bias) {
        *square += b * (b - 2.0 * *mean);
        *mean -= b;
    }
    for frame in &mut field.first {
        frame.iter_mut().zip(bias).for_each(|(e, b)| *e -= b);
    }
}

/// Sum of the terms at every pixel of every field; empty when there are none.
pub(in crate::diagnose) fn pixel_terms(
    fields: &[Field],
    terms: &[Term],
    light: Light,
    bench: &Workbench<'_>,
) -> Vec<Vec<f32>> {
    if terms.is_empty() {
        return Vec::new();
    }
    let (still, others) = Still::of(terms, bench);
    fields
        .par_iter()
        .map(|f| {
            let of_view = || Places::of(f, &bench.sensor.camera, &bench.rays);
            let places = (!others.is_empty()).then(of_view);
            (0..f.pixels.len())
                .map(|k| {
                    let disparity = f.disparity(k, &bench.rays);
                    let at = |s: &Still| s.at(f.pixels[k], disparity);
                    let mut sum: f64 = still.iter().map(at).sum();
                    if let Some(places) = &places {
                        let mut place = places.pixel(k);
                        place.light = light.of(f, k, &place);
                        sum += Term::sum(&others, &place);
                    }
                    sum as f32
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::Plane;
    use crate::simulate::kinect_v1;
    use crate::terms::{Basis, Coordinate, Modulation};

    /// Tabulated values agree with the terms themselves at the pixels of a tilted view.
    #[test]
    fn what_stands_still_is_its_picture_times_a_power_of_the_disparity() {
        let sensor = kinect_v1(4);
        let bench = Workbench::new(&sensor, crate::measure::MeasureOptions::default());
        let (camera, times) = (&sensor.camera, Modulation::DisparitySquared);
        let [width, height] = [camera.width, camera.height].map(|n| n as f64);
        let (low, high) = (0.0, width);
        let bases = [
            Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(-0.5)),
            Basis::waves(Coordinate::Column, 20.0, 2),
            Basis::Curve { over: Coordinate::Column, low, high, nodes: 9, times: Modulation::One },
            Basis::Curve { over: Coordinate::Radius, low, high: 1.0, nodes: 6, times },
            Basis::Map { width, height, across: 5, down: 4, times: Modulation::One },
            Basis::Spline { width, height, across: 5, down: 4, times },
            Basis::Affine { times },
            Basis::waves(Coordinate::Disparity, 1.0, 2),
            Basis::powers(Coordinate::RaySquared, 1, Modulation::Tilt),
            Basis::relief(2),
        ];
        const STILL: usize = 7;
        let term = |basis: Basis| {
            let coefficients = (0..basis.count()).map(|k| (1.7 * k as f64).sin() + 0.1).collect();
            Term { statistic: Statistic::Bias, basis, coefficients }
        };
        let terms: Vec<Term> = bases.into_iter().map(term).collect();
        let (still, others) = Still::of(&terms, &bench);
        assert_eq!(others, terms[STILL..]);
        let size = [camera.width, camera.height];
        let pixels: Vec<u32> = (0..(camera.width * camera.height) as u32).step_by(37).collect();
        let mut field = Field::unseen(Plane::tilted(1.5, 0.9, 0.4), 43.5, size, pixels);
        field.edge = vec![9.0; field.pixels.len()];
        let places = Places::of(&field, camera, &bench.rays);
        for k in 0..field.pixels.len() {
            let truth = Term::sum(&terms[..STILL], &places.pixel(k));
            let disparity = field.disparity(k, &bench.rays);
            let at = |s: &Still| s.at(field.pixels[k], disparity);
            let sum: f64 = still.iter().map(at).sum();
            assert!((sum - truth).abs() < 1e-10 * truth.abs().max(1.0), "{k}: {sum} {truth}");
        }
    }
}
