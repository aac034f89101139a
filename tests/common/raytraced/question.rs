//! Types exchanged between the worlds that make sets, the solver and the judge.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use kinoise::correct::Conditions;
use kinoise::error::Result;
use kinoise::view::Sensor;

/// Where a set comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum World {
    /// Rays and disparity.
    Rays,
    /// Speckle: dots, light and a block matcher.
    Light,
    /// Recordings that a real sensor took.
    Real,
}

/// Kind of question that a set asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cell {
    /// Nothing is left out.
    Null,
    /// The unit's own sigma is no longer what its model says.
    Drift,
    Single,
    Pair,
    Triple,
    /// A cause that the catalogue lacks.
    Outside,
    /// What planes cannot show, without a reference distance.
    Blind,
    /// The same with reference distances.
    Referenced,
    /// An effect beside another that mimics it.
    Mimic,
    /// An effect in a few views only.
    FewViews,
    /// An effect in one region of the picture only.
    Region,
    /// An effect past one distance only.
    Far,
    /// An effect late in the session only.
    Late,
    /// A term that real data need is struck from the model.
    Amnesia,
    /// One half of a real recording against a model of the other.
    Halves,
}

/// What is ordered from a world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    pub world: World,
    pub cell: Cell,
    /// Effects or causes by name; chosen at random where empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// Expected log-likelihood gain of knowing the truth over the model, nats over the whole recording after
    /// planes are fitted, for every concealed cause; or as near as can be reached.
    pub nats: Option<f64>,
    pub seed: u64,
    /// 160x120 instead of 320x240.
    pub small: bool,
}

/// One cause that was concealed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    /// Catalogue ids that count as its name; empty where the catalogue lacks it.
    pub names: Vec<String>,
    /// The formula or switch used, in a word.
    pub form: String,
    pub statistic: String,
    pub axis: String,
    /// Further axes on which it shows.
    #[serde(default)]
    pub also: Vec<String>,
    pub interval: Option<[f64; 2]>,
    /// In the catalogue's names and units where the forms share them.
    pub parameters: Map<String, Value>,
    pub nats: Option<f64>,
}

impl Hidden {
    pub fn new(names: &[&str], form: &str, [statistic, axis]: [&str; 2]) -> Self {
        Hidden {
            names: names.iter().map(ToString::to_string).collect(),
            form: form.into(),
            statistic: statistic.into(),
            axis: axis.into(),
            also: Vec::new(),
            interval: None,
            parameters: Map::new(),
            nats: None,
        }
    }

    /// Its first name, or its form.
    pub fn name(&self) -> &str {
        self.names.first().unwrap_or(&self.form)
    }
}

/// The concealed answer to one set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    pub asked: Asked,
    /// Empty where the right answer is "match".
    pub hidden: Vec<Hidden>,
    /// How the recording was made; for readers.
    pub base: Value,
}

/// A view that the solver never gets: what an ideal sensor of the same unit reports, without noise.
pub struct ExamView {
    pub sensor: Sensor,
    /// Whether it is outside the distances or tilts of the recording.
    pub beyond: bool,
    pub conditions: Conditions,
    /// Mean of what is reported, concealed causes included, m; NaN off the target.
    pub depth: Vec<f32>,
    /// What the sensor would report with nothing concealed, m.
    pub plain: Vec<f32>,
    /// Standard deviation of one frame's noise with the concealed causes and without, m.
    pub sigma: Vec<f32>,
    pub sigma_plain: Vec<f32>,
}

/// Pose of the target in a view: depth at which its plane meets the optical axis, m, tilt, and the image
/// direction in which its depth grows (0 to the right), rad.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    pub z_m: f64,
    pub theta_rad: f64,
    pub azimuth_rad: f64,
}

/// A set that is ready to be taken.
pub trait ConcealedSet: Send + Sync {
    fn truth(&self) -> Truth;

    /// Writes `recording/` and either `model.json` or `simulated/` into `folder`, and nothing else. The
    /// bytes are the same every time.
    fn write(&self, folder: &Path) -> Result<()>;

    /// Fresh views for examining what was learnt; empty where the world has no noise-free truth.
    fn exam(&self) -> Vec<ExamView> {
        Vec::new()
    }

    /// The same set with one more view, as near to `pose` as its stage permits, and the pose that was taken;
    /// the other views stay identical to the last byte. `None` where no more views can be taken.
    fn with_view(&self, _pose: &Pose) -> Result<Option<(Pose, Box<dyn ConcealedSet>)>> {
        Ok(None)
    }
}
