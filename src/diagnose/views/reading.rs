//! The views as fields of residuals: read, checked, and none of them twice.

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
use crate::terms::{Axis, PixelContext, Pixels, Statistic, Term};
use crate::view::{Excluded, Recording, take_out_copies};

/// What could be read of a recording.
pub(in crate::diagnose) struct LoadedViews<'a> {
    pub fields: Vec<Field>,
    pub excluded: Vec<Excluded>,
    /// The words turned out to be ranges.
    pub ranges: Option<Finding>,
    /// What the fields were read with.
    pub bench: Workbench<'a>,
    /// What was taken out of them.
    pub known: KnownTerms,
    /// Views that were another's copy, in words.
    pub copies: Vec<String>,
}

impl<'a> LoadedViews<'a> {
    /// Every view that can be used, one at least of each.
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
        // A model may be wrong about its ranges.
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
            known.bias.push(range_term());
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

/// A view whose frames are bit-identical to another's is a duplicate and is dropped.
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

/// Views that can be used, and those that cannot.
type Read = (Vec<Field>, Vec<Excluded>);

/// By the exact test of McNemar, below this ranges are the better reading: five views that are flat
/// so, and none that are flat as depths alone. Nothing else we know of makes a plane of what is none.
const RANGES_LEVEL: f64 = 0.05;

/// Do the views become flat once their words are taken for lengths of rays? Then with them, and with
/// the chance of it were either reading as good as the other.
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
    if chance(refused, 0) > RANGES_LEVEL || known.has("range-not-depth") {
        return None;
    }
    let bench = Workbench { ray_share: 1.0, ..Workbench::new(bench.sensor, bench.options) };
    let mut told = known.clone();
    told.bias.push(range_term());
    let (fields, excluded) = read(recording, &bench, model, &told, &|_, _| ());
    if fields.len() < MIN_VIEWS {
        return None;
    }
    let only = |these: &[Field], those: &[Field]| {
        these.iter().filter(|f| those.iter().all(|g| g.name != f.name)).count() as u64
    };
    let p = chance(only(&fields, as_depths), only(as_depths, &fields));
    let none_left = || share_left(&fields, &bench).is_some_and(|s| s.abs() < PART_OF_RANGES);
    (p <= RANGES_LEVEL && none_left()).then_some(((fields, excluded), p))
}

/// Raw values hold ranges or depths: where fields that were read as ranges are off by more than this share
/// of the difference, something else bends the planes. Simulated ranges leave less than 1e-4, a lens of
/// k1 = 0.05 beside them 0.007, 0.87 of ranges 0.12.
const PART_OF_RANGES: f64 = 0.05;
/// Pixels of a view from one that is looked at to the next.
const STRIDE: usize = 61;

/// What the fields' means still have of ranges in place of depths, beside a plane of each view's own.
fn share_left(fields: &[Field], bench: &Workbench<'_>) -> Option<f64> {
    let of_view = |f: &Field| {
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
        let rows = view.rows(&view.response)?;
        Some(rows.reduce(1, |i, row| RAY_FOR_DEPTH.fill(&places[i], row)))
    };
    let (a, b) = fields
        .iter()
        .filter_map(of_view)
        .fold((0.0, 0.0), |(a, b), e| (a + e.a[(0, 0)], b + e.b[0]));
    (a > 0.0).then(|| b / a)
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
    let times = recording.views.iter().filter_map(|v| v.depth.first()).map(|f| f.timestamp);
    let start = times.fold(f64::INFINITY, f64::min);
    recording.each_view(progress, |v| Field::read(v, bench, &model.sigma, known, start))
}
