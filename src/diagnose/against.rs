//! A simulated recording in the model's place: view by view, what the real one shows beyond it.
//!
//! Means are compared tile by tile, each about its own plane; variances block by block; the
//! structure of the noise view by view. Both sides' errors count.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::engine::{DiagnoseOptions, FEWEST_VIEWS};
use super::field::Field;
use super::hanging::Hanging;
use super::in_time::still_level;
use super::known::KnownTerms;
use super::lattice::Quantisation;
use super::layers::{BLOCK_TILES, Survey};
use super::missing::{DropoutFinding, missing};
use super::noise::hanging;
use super::partners::{Pose, partners};
use super::pixels::{common, fixed_px2, measure_tails};
use super::reading::read;
use super::rim;
use super::samples::ViewData;
use super::scatter::{Left, left_by_fit};
use super::steps::{Steps, lattice};
use super::structure::{Structure, structures};
use super::tails::tails;
use super::tiles::SIDE;
use crate::Progress;
use crate::error::{Error, Result};
use crate::measure::Workbench;
use crate::model::NoiseModel;
use crate::view::{Recording, Sensor};

/// The simulated views, in the order of the real ones they belong to.
pub struct Baseline {
    pub fields: Vec<Field>,
    survey: Survey,
    structure: Vec<Structure>,
    hangs: Vec<Hanging>,
    lattice: Quantisation,
    /// Variance with another name.
    pub steps: Steps,
    lost: Vec<DropoutFinding>,
    mixes: bool,
    heavy: bool,
    /// What was odd, in words.
    pub remarks: Vec<String>,
}

/// Gross errors make the noise of one view in two runs differ, in log variance.
const ANOTHER_RUN: f64 = 0.12;

/// Tails of two recordings are no news within this factor: gross errors come in clumps.
const TAILS_ALIKE: f64 = 3.0;

/// How much more the blocks of a view scatter about a plane in the picture than Gaussian noise
/// would make them: the square of a ratio, at least 1.
fn scatter(view: &ViewData) -> f64 {
    let n = view.places.len();
    if n < 6 {
        return 1.0;
    }
    let root: Vec<f64> = view.weight.iter().map(|w| w.sqrt()).collect();
    let x = nalgebra::DMatrix::from_fn(n, 3, |i, k| {
        root[i] * [1.0, view.places[i].x, view.places[i].y][k]
    });
    let y = nalgebra::DVector::from_fn(n, |i, _| root[i] * view.response[i]);
    let Some(Left { squares: chi2, free }) = left_by_fit(x, &y) else { return 1.0 };
    // Four standard deviations beyond what chance makes.
    if chi2 > free + 4.0 * (2.0 * free).sqrt() { chi2 / free } else { 1.0 }
}

/// Numbers of two cameras that differ by less are the same, as a share.
const SAME: f64 = 0.01;

impl Baseline {
    /// Read `simulated` and keep of `fields` those views that have a partner there.
    pub fn of(
        simulated: &Recording,
        real: &Sensor,
        fields: &mut Vec<Field>,
        model: &NoiseModel,
        options: &DiagnoseOptions,
        progress: Progress<'_>,
    ) -> Result<Self> {
        // Disparities of both in the same px.
        let sensor = Sensor { baseline_m: real.baseline_m, ..simulated.sensor.clone() };
        same_sensor(real, &simulated.sensor)?;
        let bench = Workbench::new(&sensor, super::engine::measure_options(options));
        let known = KnownTerms::of(model, &sensor.camera);
        let (theirs, excluded) = read(simulated, &bench, model, &known, progress);
        let mut remarks: Vec<String> =
            excluded.iter().map(|e| format!("of the simulated recording, {e}")).collect();
        let poses = |fields: &[Field]| fields.iter().map(Pose::of).collect::<Vec<_>>();
        let partner = partners(&poses(fields), &poses(&theirs));
        let all = fields.len();
        let mut left: Vec<Option<Field>> = theirs.into_iter().map(Some).collect();
        let mut kept = Vec::new();
        let mut theirs = Vec::new();
        for (field, partner) in fields.drain(..).zip(partner) {
            match partner.and_then(|p| left[p].take()) {
                Some(twin) => {
                    kept.push(field);
                    theirs.push(twin);
                }
                None => remarks.push(format!(
                    "view {} was left out: the simulated recording has no view of this pose",
                    field.name
                )),
            }
        }
        *fields = kept;
        if theirs.len() < FEWEST_VIEWS {
            return Err(Error::NotEnough {
                what: format!("{} of {all} views have a partner in {}", theirs.len(), simulated.root.display()),
                remedy: "simulate the very views of the recording (kinoise simulate OUT --like REC), three at least".into(),
            });
        }
        let unused = left.iter().flatten().count();
        if unused > 0 {
            remarks.push(format!("{unused} simulated views have no partner in the recording"));
        }
        let mut baseline = Baseline::measured(simulated, theirs, &bench, options);
        baseline.remarks = remarks;
        Ok(baseline)
    }

    fn measured(
        simulated: &Recording,
        fields: Vec<Field>,
        bench: &Workbench<'_>,
        options: &DiagnoseOptions,
    ) -> Self {
        let camera = &bench.sensor.camera;
        let none = KnownTerms::default();
        let mut survey = Survey::of(&fields, camera, &bench.rays);
        let mut structure = structures(&fields, camera, &[]);
        let hangs = hanging(&structure, &none, 0.03 * options.level);
        survey.compare_frames(&fields, common(&structure, &hangs, &none));
        measure_tails(&mut structure, &fields, &[], &[], &survey, bench);
        let lattice = lattice(&fields, simulated);
        let steps = Steps::of(&lattice, &structure, &fields, simulated);
        let lost = missing(&fields, &survey, camera, &bench.rays, options.seed).findings;
        Baseline {
            mixes: rim::mixing(&fields, 0.03 * options.level).is_some(),
            heavy: tails(&structure, &none, 0.03 * options.level, false).is_some(),
            fields,
            survey,
            structure,
            hangs,
            lattice,
            steps,
            lost,
            remarks: Vec::new(),
        }
    }

    /// Distances by other means, off by what the simulated view's own are off.
    pub fn references(&self, fields: &mut [Field]) {
        for (real, twin) in fields.iter_mut().zip(&self.fields) {
            if let (Some(reference), Some(own)) =
                (&mut real.reference_distance_m, twin.reference_distance_m)
            {
                *reference += twin.plane.depth(0.0, 0.0) - own;
            }
        }
    }

    /// Take the simulated mean out of the real one, tile by tile.
    pub fn means(&self, survey: &mut Survey) {
        survey.fixed_px2 += fixed_px2(&self.structure);
        for (real, twin) in survey.views.iter_mut().zip(&self.survey.views) {
            let theirs: HashMap<(u32, u32), f64> =
                twin.tiles.iter().map(|t| (patch(t.place.u, t.place.v, SIDE), t.mean)).collect();
            for t in Arc::make_mut(&mut real.tiles) {
                let mean = theirs.get(&patch(t.place.u, t.place.v, SIDE)).copied();
                match mean.filter(|m| m.is_finite()) {
                    Some(m) => {
                        t.square += m * m - 2.0 * m * t.mean;
                        t.mean -= m;
                    }
                    // Seen by one of them alone: nothing to compare.
                    None => (t.mean, t.pixels) = (f64::NAN, 0.0),
                }
            }
            real.inflation += twin.inflation;
        }
    }

    /// The simulated variance in the place of the model's, block by block; `false` where the
    /// simulated views hardly have any.
    pub fn variances(&mut self, survey: &mut Survey) -> bool {
        // Of noise that hardly changes from frame to frame all is measured, in both or in neither.
        for (real, twin) in survey.views.iter_mut().zip(&mut self.survey.views) {
            if real.moving.is_none() || twin.moving.is_none() {
                (real.moving, twin.moving) = (None, None);
            }
        }
        let theirs = self.survey.variance_data();
        let count = |data: &[ViewData]| data.iter().map(|v| v.places.len()).sum::<usize>();
        if 2 * count(&theirs) < count(&survey.variance_data()) {
            self.remarks.push("the simulated recording has hardly any noise: the size of the noise was held against the model's sigma".into());
            return false;
        }
        for (real, twin) in survey.views.iter_mut().zip(&theirs) {
            let side = BLOCK_TILES * SIDE;
            let logs: BTreeMap<(u32, u32), f64> = twin
                .places
                .iter()
                .zip(&twin.response)
                .map(|(p, y)| (patch(p.u, p.v, side), *y))
                .collect();
            // Terms that depend on the variance itself must not have the blocks' errors in them: these
            // are in what they are fitted to.
            let smooth = logs.values().sum::<f64>() / logs.len().max(1) as f64;
            for t in Arc::make_mut(&mut real.tiles) {
                t.place.variance = t.variance * smooth.exp();
                match logs.get(&patch(t.place.u, t.place.v, side)) {
                    Some(log) => t.variance *= log.exp(),
                    None => (t.temporal, t.rough_square) = (f64::NAN, f64::NAN),
                }
            }
        }
        true
    }

    /// The simulated variances are as uncertain as the real ones, and both more so than a
    /// Gaussian's where gross errors come in clumps.
    pub fn doubt(&self, survey: &mut Survey) {
        survey.tolerance = ANOTHER_RUN;
        let (ours, theirs) = (survey.variance_data(), self.survey.variance_data());
        let mean = |v: &ViewData| v.weight.iter().sum::<f64>() / v.weight.len().max(1) as f64;
        for (view, (ours, theirs)) in survey.views.iter_mut().zip(ours.iter().zip(&theirs)) {
            let (w, t) = (mean(ours), mean(theirs));
            if w > 0.0 && t > 0.0 {
                let clumps = scatter(ours).max(scatter(theirs));
                view.doubt = clumps * (w + t) / t;
            }
        }
    }

    /// Replace each statistic of the real views by its difference to the twin's, on the level of
    /// the simulated recording; what that level is goes to `known`.
    pub fn compare(
        &self,
        structure: &mut [Structure],
        real: &Quantisation,
        known: &mut KnownTerms,
    ) {
        let ours = structure;
        let level = |of: &dyn Fn(&Structure) -> Option<f64>| {
            let all: Vec<f64> =
                self.structure.iter().filter_map(of).filter(|v| v.is_finite()).collect();
            all.iter().sum::<f64>() / all.len().max(1) as f64
        };
        let windows = level(&|s| s.window_px.map(f64::ln));
        let (fixed, rows) = (level(&|s| s.fixed_px2), level(&|s| s.row_px2));
        let columns = level(&|s| s.column_px2);
        let lags: [f64; 3] = std::array::from_fn(|k| level(&|s| s.lagged[k]));
        for (s, twin) in ours.iter_mut().zip(&self.structure) {
            let differ = |real: &mut Option<f64>, twin: Option<f64>, level: f64| {
                *real = real.zip(twin).map(|(r, t)| r - t + level);
            };
            s.window_px = s.window_px.zip(twin.window_px).map(|(r, t)| r / t * windows.exp());
            differ(&mut s.fixed_px2, twin.fixed_px2, fixed.max(0.0));
            differ(&mut s.row_px2, twin.row_px2, rows.max(0.0));
            // Nothing is known of columns: what both have must vanish.
            differ(&mut s.column_px2, twin.column_px2, columns.min(0.0));
            differ(&mut s.lines_px2, twin.lines_px2, 0.0);
            for (k, lag) in lags.iter().enumerate() {
                if twin.lagged[k].is_some() {
                    differ(&mut s.lagged[k], twin.lagged[k], *lag);
                }
            }
        }
        known.learn("spatial-correlation", "length_px", windows.exp());
        known.learn("fixed-pattern-noise", "sigma_px", fixed.max(0.0).sqrt());
        known.learn("row-noise", "sigma_px", rows.max(0.0).sqrt());
        let still = still_level(&self.structure).filter(|share| *share > 0.0);
        if let Some(share) = still {
            known.learn("frozen-noise", "fraction", share);
        }
        let once = ["frozen-noise", "temporal-correlation", "frame-jitter", "target-motion"];
        let once = &once[usize::from(still.is_some())..];
        for hang in &self.hangs {
            for id in once.iter().filter(|id| hang.families.contains(id)) {
                for (name, value) in &hang.parameters {
                    known.learn(id, name, value["value"].as_f64().unwrap_or(0.0));
                }
            }
        }
        if self.heavy {
            known.learn("heavy-tails", "fraction", 0.0);
        }
        if self.mixes {
            known.learn("edge-mixing", "width_px", 0.0);
        }
        let alike = |a: Option<f64>, b: Option<f64>| {
            a.zip(b).is_some_and(|(a, b)| (a / b).ln().abs() < STEPS_ALIKE)
        };
        if alike(self.lattice.disparity_step_px, real.disparity_step_px) {
            known.learn("disparity-quantisation", "step_px", 0.0);
        }
        if alike(self.lattice.depth_step_m, real.depth_step_m) {
            known.learn("depth-rounding", "step_m", 0.0);
        }
    }

    /// Are the recording's tails no heavier than those of the simulation, by much?
    pub fn tails_alike(&self, real: &[Structure]) -> bool {
        let mean = |all: &[Structure]| {
            let looked: Vec<f64> =
                all.iter().filter(|s| s.tail_pixels > 0.0).map(|s| s.tail).collect();
            looked.iter().sum::<f64>() / looked.len().max(1) as f64
        };
        mean(real) < TAILS_ALIKE * mean(&self.structure)
    }

    /// Is as much lost in the simulated views, for the same reason or on the whole?
    pub fn loses_alike(&self, lost: &DropoutFinding, real: &Survey) -> bool {
        let same = self.lost.iter().any(|own| {
            own.family == lost.family
                && own.axis == lost.axis
                && (own.size.max(1e-6) / lost.size.max(1e-6)).ln().abs() < LOSSES_ALIKE
        });
        // What lies beside the target is no tile's.
        let on_target = lost.family != Some("occlusion-shadow");
        same || on_target && lost_share(real) < 1.2 * lost_share(&self.survey) + LOST_BY_LOT
    }

    /// What the simulation shows and the recording does not, in words.
    pub fn too_much(&self, real: &[Structure], level: f64) -> Vec<String> {
        let ours = hanging(real, &KnownTerms::default(), level);
        let names = |all: &[Hanging]| -> Vec<&'static str> {
            all.iter().filter_map(|h| h.families.first().copied()).collect()
        };
        let shown = names(&ours);
        names(&self.hangs)
            .into_iter()
            .filter(|id| !shown.contains(id))
            .map(|id| format!("the simulated recording shows {id}, the real one does not"))
            .collect()
    }
}

/// Steps that differ by less are the same, as a logarithm.
const STEPS_ALIKE: f64 = 0.05;
/// A share of the pixels that nobody misses.
const LOST_BY_LOT: f64 = 0.0005;
/// Losses whose sizes differ by less are the same: views lose by lot.
const LOSSES_ALIKE: f64 = 0.4;

/// Of all that was asked of the target's pixels.
fn lost_share(survey: &Survey) -> f64 {
    let tiles = || survey.views.iter().flat_map(|v| v.tiles.iter());
    let asked: f64 = tiles().map(|t| t.asked).sum();
    tiles().map(|t| t.asked * t.missing).sum::<f64>() / asked.max(1.0)
}

fn patch(u: f64, v: f64, side: usize) -> (u32, u32) {
    ((v / side as f64) as u32, (u / side as f64) as u32)
}

/// Pictures can be laid over one another only when one camera took both.
fn same_sensor(real: &Sensor, simulated: &Sensor) -> Result<()> {
    let (a, b) = (&real.camera, &simulated.camera);
    let remedy = "simulate the sensor of the recording: the same recording.json";
    let differ = |what: String| Err(Error::Argument { what, remedy });
    if (a.width, a.height) != (b.width, b.height) {
        return differ(format!(
            "--against: its images are {} x {} px, the recording's {} x {}",
            b.width, b.height, a.width, a.height
        ));
    }
    let baselines = [real.baseline_m, simulated.baseline_m].map(|b| b.unwrap_or(f64::NAN));
    let numbers = [
        ("fx", a.fx, b.fx, a.fx),
        ("fy", a.fy, b.fy, a.fy),
        ("cx", a.cx, b.cx, a.fx),
        ("cy", a.cy, b.cy, a.fy),
        ("baseline_m", baselines[0], baselines[1], baselines[0]),
    ];
    match numbers.iter().find(|(_, a, b, scale)| (a - b).abs() > SAME * scale) {
        None => Ok(()),
        Some((name, a, b, _)) => {
            differ(format!("--against: another sensor: its {name} is {b}, the recording's {a}"))
        }
    }
}
