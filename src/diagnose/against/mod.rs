//! A simulated recording in place of the model: what the real one shows beyond it, view by view.
//!
//! Means are compared tile by tile, each about its own plane, and variances block by block (`layers`); the
//! structure of the noise view by view (`textures`). The errors of both sides count.

pub mod layers;
pub mod noise;
pub mod textures;

use std::f64::consts::TAU;

use crate::Progress;
use crate::diagnose::finding::pixels::{Whitener, common, measure_tails};
use crate::diagnose::noise::still::KeptPattern;
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::structures::structures;
use crate::diagnose::noise::tails::{Confusers, tails};
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::diagnose::noise::{texture_findings, window};
use crate::diagnose::options::{DiagnoseOptions, EACH_LEVEL, MIN_VIEWS, measure_options};
use crate::diagnose::steps::lattice::Step;
use crate::diagnose::steps::{Steps, forget_windows, measure_steps};
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::reading::read;
use crate::error::{Error, Result};
use crate::measure::Workbench;
use crate::model::NoiseModel;
use crate::plane::Plane;
use crate::view::{Excluded, Recording, Sensor};

/// The simulated views, in the order of the real ones they belong to.
pub struct Baseline {
    pub fields: Vec<Field>,
    pub(in crate::diagnose) survey: Survey,
    pub(in crate::diagnose) structure: Vec<Structure>,
    pub(in crate::diagnose) textures: Vec<TextureFinding>,
    pub(in crate::diagnose) lattice: Option<Step>,
    /// Variance with a cause of its own: quantisation steps and row noise.
    pub steps: Steps,
    pub(in crate::diagnose) heavy: bool,
    /// Whether its noise went through a window: a matcher's, or that of a formula which imitates one.
    pub(in crate::diagnose) has_a_window: bool,
    /// Oddities, in words.
    pub remarks: Vec<String>,
}

/// Relative difference up to which numbers of two cameras are the same.
const SAME: f64 = 0.01;

impl Baseline {
    /// Reads `simulated` and keeps those `fields` that have a partner there; returns the others as excluded.
    pub fn of(
        simulated: &Recording,
        real: &Sensor,
        fields: &mut Vec<Field>,
        model: &NoiseModel,
        options: &DiagnoseOptions,
        progress: Progress<'_>,
    ) -> Result<(Self, Vec<Excluded>)> {
        // Disparities of both in the same px.
        let sensor = Sensor { baseline_m: real.baseline_m, ..simulated.sensor.clone() };
        same_sensor(real, &simulated.sensor)?;
        let bench = Workbench::new(&sensor, measure_options(options));
        let known = KnownTerms::of(model, &sensor.camera);
        let (theirs, excluded) = read(simulated, &bench, model, &known, progress);
        let mut remarks: Vec<String> =
            excluded.iter().map(|e| format!("of the simulated recording, {e}")).collect();
        let partner = partners(fields, &theirs);
        let all = fields.len();
        let mut left: Vec<Option<Field>> = theirs.into_iter().map(Some).collect();
        let mut kept = Vec::new();
        let (mut theirs, mut without_partner) = (Vec::new(), Vec::new());
        for (field, partner) in fields.drain(..).zip(partner) {
            match partner.and_then(|p| left[p].take()) {
                Some(twin) => {
                    kept.push(field);
                    theirs.push(twin);
                }
                None => without_partner.push(Excluded {
                    view: field.name,
                    reason: "the simulated recording has no view of this pose".into(),
                }),
            }
        }
        *fields = kept;
        if theirs.len() < MIN_VIEWS {
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
        Ok((baseline, without_partner))
    }

    fn measured(
        simulated: &Recording,
        mut fields: Vec<Field>,
        bench: &Workbench<'_>,
        options: &DiagnoseOptions,
    ) -> Self {
        let lattice = measure_steps(&mut fields, simulated, &bench.rays);
        let none = KnownTerms::default();
        let mut survey = Survey::of(&fields, bench, lattice);
        survey.compared();
        let kept = KeptPattern::of(&fields);
        let mut structure = structures(&fields, &[], &kept);
        let textures = texture_findings(&structure, &none, EACH_LEVEL * options.level);
        survey.compare_frames(&fields, common(&structure, &textures, &none));
        let whitener = Whitener { sigma: None, terms: &[], survey: &survey, bench };
        measure_tails(&mut structure, &fields, &[], &whitener);
        let steps = Steps::of(lattice, &structure, &fields, simulated);
        let mut unstepped = structure.clone();
        forget_windows(&mut unstepped, &fields, lattice, simulated);
        let confusers = Confusers { simulated: true, ..Confusers::default() };
        Baseline {
            heavy: tails(&structure, &none, EACH_LEVEL * options.level, confusers).is_some(),
            has_a_window: window(&unstepped, &none, EACH_LEVEL * options.level).is_some(),
            fields,
            survey,
            structure,
            textures,
            lattice,
            steps,
            remarks: Vec::new(),
        }
    }

    /// Shifts the reference distances by the error of the simulated view's own.
    pub fn references(&self, fields: &mut [Field]) {
        for (real, twin) in fields.iter_mut().zip(&self.fields) {
            if let (Some(reference), Some(own)) =
                (&mut real.reference_distance_m, twin.reference_distance_m)
            {
                *reference += twin.plane.depth(0.0, 0.0) - own;
            }
        }
    }
}

/// Checks that one camera took both: only then can their pictures be compared pixel by pixel.
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

/// Largest differences of the same pose: share of the distance, tilt, direction of the tilt.
const Z_SHARE: f64 = 0.1;
const THETA_RAD: f64 = 8.0 * TAU / 360.0;
const AZIMUTH_RAD: f64 = 30.0 * TAU / 360.0;
/// Below this tilt a plane has no direction.
const TILTED_RAD: f64 = 10.0 * TAU / 360.0;

/// Distance between two planes, in tolerances; `None` where one is exceeded.
fn off(real: &Plane, simulated: &Plane) -> Option<f64> {
    let [z, z_simulated] = [real, simulated].map(|p| p.depth(0.0, 0.0));
    let [theta, theta_simulated] = [real, simulated].map(Plane::theta);
    let turned = (simulated.azimuth() - real.azimuth()).rem_euclid(TAU);
    let tilted = theta.max(theta_simulated) > TILTED_RAD;
    let z = (z_simulated - z).abs() / (Z_SHARE * z);
    let theta = (theta_simulated - theta).abs() / THETA_RAD;
    let azimuth = if tilted { turned.min(TAU - turned) / AZIMUTH_RAD } else { 0.0 };
    (z.max(theta).max(azimuth) <= 1.0).then_some(z + theta + azimuth)
}

/// Index of the simulated view for each real one, none used twice. A name alone is not enough: numbered views
/// of two recordings have the same names.
fn partners(real: &[Field], simulated: &[Field]) -> Vec<Option<usize>> {
    let mut pairs: Vec<(bool, f64, usize, usize)> = Vec::new();
    for (i, r) in real.iter().enumerate() {
        for (j, s) in simulated.iter().enumerate() {
            if let Some(off) = off(&r.plane, &s.plane) {
                pairs.push((r.name != s.name, off, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3))));
    let mut found = vec![None; real.len()];
    let mut taken = vec![false; simulated.len()];
    for (_, _, i, j) in pairs {
        if found[i].is_none() && !taken[j] {
            (found[i], taken[j]) = (Some(j), true);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(name: &str, z_m: f64, theta_deg: f64, azimuth_deg: f64) -> Field {
        let plane = Plane::tilted(z_m, theta_deg.to_radians(), azimuth_deg.to_radians());
        Field { name: name.into(), ..Field::unseen(plane, 43.5, [1, 1], vec![0]) }
    }

    #[test]
    fn names_come_first_then_poses_and_none_serves_twice() {
        let real = [
            pose("a", 1.0, 30.0, 179.0),
            pose("b", 1.0, 2.0, 90.0),
            pose("c", 2.0, 0.0, 0.0),
            pose("d", 2.0, 40.0, 0.0),
        ];
        let simulated = [
            pose("c", 2.1, 0.0, 0.0),
            // Named like a, with another pose.
            pose("a", 3.0, 30.0, 179.0),
            pose("x", 1.02, 33.0, -175.0),
            pose("y", 0.97, 1.0, 0.0),
            pose("z", 0.98, 1.0, 0.0),
        ];
        let found = partners(&real, &simulated);
        assert_eq!(found, [Some(2), Some(4), Some(0), None]);
    }
}
