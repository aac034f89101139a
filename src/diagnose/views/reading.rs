//! Reads the views as fields of residuals, checks them and drops duplicates.

use std::iter::Sum;

use statrs::distribution::{Binomial, Discrete, DiscreteCDF};

use super::field::Field;
use super::known::KnownTerms;
use super::samples::ViewData;
use crate::Progress;
use crate::diagnose::diagnosis::Finding;
use crate::diagnose::finding::other_findings::named;
use crate::diagnose::finding::parameters::one;
use crate::diagnose::options::MIN_VIEWS;
use crate::effects::RAY_FOR_DEPTH;
use crate::error::{Error, Result};
use crate::measure::Workbench;
use crate::model::NoiseModel;
use crate::terms::{ANYWHERE, Axis, PixelContext, Pixels, Statistic, Term};
use crate::view::{Excluded, Recording, take_out_copies};

/// The usable views of a recording.
pub(in crate::diagnose) struct LoadedViews<'a> {
    pub fields: Vec<Field>,
    pub excluded: Vec<Excluded>,
    /// Finding that the raw values are ranges, not depths.
    pub ranges: Option<Finding>,
    /// Workbench the fields were read with.
    pub bench: Workbench<'a>,
    /// Known terms that were subtracted from them.
    pub known: KnownTerms,
    /// Remarks on views that were copies of another.
    pub copies: Vec<String>,
}

impl<'a> LoadedViews<'a> {
    /// Reads every view that can be used; of identical views one is kept.
    ///
    /// # Errors
    /// When fewer than three views are left.
    pub fn of(
        recording: &Recording,
        mut bench: Workbench<'a>,
        model: &NoiseModel,
        progress: Progress<'_>,
    ) -> Result<Self> {
        let mut known = KnownTerms::of(model, &bench.sensor.camera);
        bench.ray_share = known.ray_share().clamp(0.0, 1.0);
        let (mut fields, mut excluded) = read(recording, &bench, model, &known, progress);
        // The model may be wrong in taking the raw values for ranges.
        if bench.ray_share > 0.0 && fields.len() < recording.views.len() {
            let plain = Workbench::new(bench.sensor, bench.options);
            let as_depths = read(recording, &plain, model, &known, &|_, _| ());
            if as_depths.0.len() > fields.len() {
                (bench, (fields, excluded)) = (plain, as_depths);
            }
        }
        let mut found = None;
        if let Some((flat, p)) = as_ranges(recording, &bench, model, &known, &fields) {
            (fields, excluded) = flat;
            bench.ray_share = 1.0;
            known.bias.push((range_term(), ANYWHERE));
            found = Some(ranges(p));
        }
        let copies = without_copies(&mut fields);
        if fields.len() < MIN_VIEWS {
            let first = excluded
                .first()
                .map_or_else(String::new, |e| format!("; view {}: {}", e.view, e.reason));
            return Err(Error::recording(
                &recording.root,
                format!("{} of {} views can be used{first}", fields.len(), recording.views.len()),
                "a diagnosis needs at least three views of a plane",
            ));
        }
        Ok(LoadedViews { fields, excluded, ranges: found, bench, known, copies })
    }
}

/// Drops views whose frames are bit-identical to another's and returns a remark on each.
fn without_copies(fields: &mut Vec<Field>) -> Vec<String> {
    let copies = take_out_copies(fields, |a, b| {
        a.words.0 == b.words.0
            && a.frames.len() == b.frames.len()
            && a.pixels == b.pixels
            && a.first.first().map(|f| bits(f)) == b.first.first().map(|f| bits(f))
    });
    let told = |(copy, first): (Field, usize)| {
        let first = &fields[first].name;
        format!("view {} has the same frames as view {first}: it was left out", copy.name)
    };
    copies.into_iter().map(told).collect()
}

fn bits(residuals: &[f32]) -> Vec<u32> {
    residuals.iter().map(|r| r.to_bits()).collect()
}

/// Usable views, and the excluded ones.
type Read = (Vec<Field>, Vec<Excluded>);

/// Level of the exact sign test for reading raw values as ranges: reached by five views that are flat only as
/// ranges, or flatter as these, and none as depths.
const RANGES_LEVEL: f64 = 0.05;

/// Tests whether the views become flat once their raw values are read as ranges. If so, returns them read
/// that way, with the p-value under both readings being equally good.
fn as_ranges(
    recording: &Recording,
    bench: &Workbench<'_>,
    model: &NoiseModel,
    known: &KnownTerms,
    as_depths: &[Field],
) -> Option<(Read, f64)> {
    let chance = |won: u64, lost: u64| {
        Binomial::new(0.5, won + lost).map_or(1.0, |b| b.pmf(won) + b.sf(won))
    };
    let refused = (recording.views.len() - as_depths.len()) as u64;
    let bowls: Vec<Bowl> = as_depths.iter().map(|f| Bowl::of(f, bench)).collect();
    let bent = bowls.iter().copied().sum::<Bowl>().is_nearer_to_ranges();
    if known.has("range-not-depth") || !(bent || chance(refused, 0) <= RANGES_LEVEL) {
        return None;
    }
    let bench = Workbench { ray_share: 1.0, ..Workbench::new(bench.sensor, bench.options) };
    let mut told = known.clone();
    told.bias.push((range_term(), ANYWHERE));
    let (fields, excluded) = read(recording, &bench, model, &told, &|_, _| ());
    if fields.len() < MIN_VIEWS {
        return None;
    }
    let in_depths = |f: &&Field| as_depths.iter().any(|g| g.name == f.name);
    let alone = fields.iter().filter(|f| !in_depths(f)).count();
    let bent = bowls.iter().filter(|b| b.is_nearer_to_ranges()).count();
    let p = chance((alone + bent) as u64, (as_depths.len() - bent) as u64);
    let left: Bowl = fields.iter().map(|f| Bowl::of(f, &bench)).sum();
    let none_left = left.share().is_some_and(|s| s.abs() < PART_OF_RANGES);
    (p <= RANGES_LEVEL && none_left).then_some(((fields, excluded), p))
}

/// Largest share of the range-depth difference that may remain once raw values are read as ranges; beyond it
/// something else bends the planes. Simulated ranges leave less than 1e-4, with a lens of k1 = 0.05 as well
/// 0.007, and 0.87 of ranges 0.12.
const PART_OF_RANGES: f64 = 0.05;
/// Step between the sampled pixels.
const STRIDE: usize = 61;

/// Normal equation of the share of the range-depth difference in a mean, beside a plane.
#[derive(Debug, Clone, Copy, Default)]
struct Bowl {
    a: f64,
    b: f64,
}

impl Bowl {
    fn of(f: &Field, bench: &Workbench<'_>) -> Self {
        let pixels = Pixels::new(&bench.sensor.camera, &bench.rays, f.scale_px_m);
        let seen = (0..f.pixels.len()).step_by(STRIDE).filter(|&k| f.mean[k].is_finite());
        let mut view = ViewData { precision: vec![0.0; 3], ..ViewData::default() };
        let mut places = Vec::new();
        for k in seen {
            let disparity = f.disparity(k, &bench.rays);
            let place = PixelContext { disparity, ..pixels.place(f.pixels[k] as usize) };
            view.response.push(f64::from(f.mean[k]));
            view.weight.push(1.0);
            view.nuisance.extend([1.0, place.x, place.y]);
            places.push(place);
        }
        view.rows(&view.response).map_or_else(Bowl::default, |rows| {
            let e = rows.evidence(&RAY_FOR_DEPTH, &places);
            Bowl { a: e.a[(0, 0)], b: e.b[0] }
        })
    }

    fn share(&self) -> Option<f64> {
        (self.a > 0.0).then(|| self.b / self.a)
    }

    /// Depths have none of the difference and ranges all of it; halfway both fit as well.
    fn is_nearer_to_ranges(&self) -> bool {
        self.share().is_some_and(|share| share > 0.5)
    }
}

impl Sum for Bowl {
    fn sum<I: Iterator<Item = Bowl>>(all: I) -> Bowl {
        all.fold(Bowl::default(), |s, o| Bowl { a: s.a + o.a, b: s.b + o.b })
    }
}

fn range_term() -> Term {
    Term::bias(RAY_FOR_DEPTH, vec![1.0])
}

/// The finding that goes with [`as_ranges`].
fn ranges(p: f64) -> Finding {
    Finding {
        share: 1e6,
        parameters: one("share", 1.0, 0.01),
        p_adjusted: Some(p),
        terms: vec![range_term()],
        ..named("range-not-depth", Statistic::Bias, Axis::Radius)
    }
}

pub(in crate::diagnose) fn read(
    recording: &Recording,
    bench: &Workbench<'_>,
    model: &NoiseModel,
    known: &KnownTerms,
    progress: Progress<'_>,
) -> Read {
    let start = recording.start_s();
    recording.each_view(progress, |v| Field::read(v, bench, &model.sigma, known, start))
}
