//! A simulated recording in the model's place: view by view, what the real one shows beyond it.
//!
//! Means are compared tile by tile, each about its own plane, and variances block by block
//! (`against_layers`); the structure of the noise view by view (`against_textures`). Both sides'
//! errors count.

use super::engine::{DiagnoseOptions, FEWEST_VIEWS, measure_options};
use super::field::Field;
use super::hanging::Hanging;
use super::known::KnownTerms;
use super::lattice::Quantisation;
use super::layers::Survey;
use super::missing::{DropoutFinding, missing};
use super::noise::hanging;
use super::partners::{Pose, partners};
use super::pixels::{common, measure_tails};
use super::reading::read;
use super::steps::{Steps, lattice};
use super::structure::{Structure, structures};
use super::tails::tails;
use crate::Progress;
use crate::error::{Error, Result};
use crate::measure::Workbench;
use crate::model::NoiseModel;
use crate::view::{Recording, Sensor};

/// The simulated views, in the order of the real ones they belong to.
pub struct Baseline {
    pub fields: Vec<Field>,
    pub(super) survey: Survey,
    pub(super) structure: Vec<Structure>,
    pub(super) hangs: Vec<Hanging>,
    pub(super) lattice: Quantisation,
    /// Variance with another name.
    pub steps: Steps,
    pub(super) lost: Vec<DropoutFinding>,
    pub(super) heavy: bool,
    /// What was odd, in words.
    pub remarks: Vec<String>,
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
        let bench = Workbench::new(&sensor, measure_options(options));
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
        let lost = missing(&fields, None, &survey, camera, options.seed).findings;
        Baseline {
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
