//! What physics does to a depth image, one cause a file.
//!
//! Light meets the surface, passes the lens, is matched into a disparity and becomes a raw depth value.
//! Each effect belongs to one [`Stage`] of that path; the driver in `simulate` walks the stages in
//! order and hands every active effect the [`Exposure`] under way. An effect at its card's identity
//! is not there, and every effect draws only from streams of its own name, so that adding one
//! changes no other.

mod active;
mod card;
mod draw;
mod exposure;
mod fitted;
mod shape;
mod traces;

pub use active::{Acting, Active};
pub use card::{Card, Parameter, Settings, Stage};
pub use draw::{Draw, Scope, fill_normal, logistic};
pub use exposure::{Exposure, Instant};
pub use fitted::{Estimate, Fitted};
pub use range_not_depth::RAY_FOR_DEPTH;
pub use traces::{Bounds, Flat, Inverse, Known, Smallest};

use crate::camera::Camera;
pub use crate::sensors::KINECT_BASELINE_M;
pub use crate::terms::ROOM_LUX;
use crate::terms::{Basis, Statistic, Term};
use draw::{chance, normals};
use fitted::{greatest, slope_in_square};

/// What has a card; `catalogue!` gives each effect the `CARD` of its file.
pub trait Carded {
    fn card(&self) -> &'static Card;
}

/// A physical effect with both its faces: what nature does to an exposure, and what a recording
/// shows of it. Effects without [`Effect::shapes`] show in textures, losses, edges or reference
/// distances, and are recognised by measurements of their own.
pub trait Effect: Carded + Send + Sync {
    /// Change `exposure` as the effect does with these settings. Called once a frame, at the
    /// card's stage, and only when the strength is not the card's identity.
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw);

    /// The fitted terms that stand in place of a formula; the catalogue's effects have none.
    fn terms(&self) -> &[Term] {
        &[]
    }

    /// What it may look like: of the mean, in px of disparity, or of the logarithm of the variance,
    /// as the card's statistic has it. A diagnosis tries them all.
    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        Vec::new()
    }

    /// A size that coefficient number `k` of one of its shapes may well have, in its unit: the standard
    /// deviation of what is believed before anything was measured. `flat` is what is stated of the
    /// target.
    fn usual(&self, _shape: &Basis, _k: usize, _flat: Option<&Flat>) -> f64 {
        USUAL_PX
    }

    /// Can a shape with these coefficients be meant, with what is stated of the target?
    fn agrees_with(&self, _flat: Option<&Flat>, _shape: &Basis, _coefficients: &[f64]) -> bool {
        true
    }

    /// The share of what the best nameless curve explains that its name must, where less than of
    /// others will do.
    fn must_explain(&self) -> Option<f64> {
        None
    }

    /// Was the axis that it follows measured for its own sake? Between equals it is then meant.
    fn rests_on_a_measurement(&self) -> bool {
        false
    }

    /// The parameters of a fitted shape.
    fn estimates(&self, _: &Fitted) -> Vec<Estimate> {
        Vec::new()
    }

    /// What known parameters make of a measurement, where that is a term.
    fn term(&self, _: Known, _: &Camera) -> Option<Term> {
        None
    }

    /// What takes it out of a depth image; nothing for what is no bias of the sensor.
    fn inverse(&self, settings: &Settings, camera: &Camera) -> Option<Inverse> {
        let term = self.term(&|name| settings.named(self.card(), name), camera)?;
        term.is_sensor_bias().then_some(Inverse::Term(term))
    }

    /// How the smallest of it that could have been found is told.
    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        None
    }
}

/// Errors of a matcher beyond a pixel are gross ones.
pub const USUAL_PX: f64 = 1.0;

/// The catalogue: an effect takes one file and one word in this list (`crate::docs::catalogue`).
macro_rules! catalogue {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(mod $module;)*

        $(impl Carded for $module::$name {
            fn card(&self) -> &'static Card {
                &$module::CARD
            }
        })*

        /// Every effect, in the order of the light's path and of `crate::docs::catalogue`.
        pub static CATALOGUE: &[&dyn Effect] = &[$(&$module::$name),*];
    };
}

catalogue! {
    disparity_quantisation::DisparityQuantisation,
    depth_rounding::DepthRounding,
    pixel_locking::PixelLocking,
    column_banding::ColumnBanding,
    radial_disparity_bias::RadialDisparityBias,
    lens_distortion::LensDistortion,
    range_not_depth::RangeNotDepth,
    depth_scale::DepthScale,
    disparity_offset::DisparityOffset,
    thermal_drift::ThermalDrift,
    target_bow::TargetBow,
    target_motion::TargetMotion,
    fixed_pattern_noise::FixedPatternNoise,
    edge_mixing::EdgeMixing,
    range_exponent::RangeExponent,
    slope_noise::SlopeNoise,
    tilt_axis_anisotropy::TiltAxisAnisotropy,
    vignetting::Vignetting,
    intensity_dependent_noise::IntensityDependentNoise,
    ambient_light::AmbientLight,
    heavy_tails::HeavyTails,
    spatial_correlation::SpatialCorrelation,
    temporal_correlation::TemporalCorrelation,
    frozen_noise::FrozenNoise,
    row_noise::RowNoise,
    frame_jitter::FrameJitter,
    grazing_dropout::GrazingDropout,
    range_dropout::RangeDropout,
    occlusion_shadow::OcclusionShadow,
}

/// The effect of this id.
pub fn find(id: &str) -> Option<&'static dyn Effect> {
    CATALOGUE.iter().copied().find(|e| e.card().id == id)
}

/// The order in which a diagnosis tries the axes of the cards: it decides ties, and which random
/// numbers the null of each candidate draws.
const TRIED: [&str; 9] = [
    "z",
    "radius",
    "theta",
    "azimuth",
    "target-position",
    "disparity-phase",
    "column",
    "edge-distance",
    "intensity",
];

/// The effects that change this statistic, in the order in which they are looked for.
pub fn that_change(statistic: Statistic) -> Vec<&'static dyn Effect> {
    let mut all: Vec<&dyn Effect> =
        CATALOGUE.iter().copied().filter(|e| e.card().statistic == statistic.id()).collect();
    all.sort_by_key(|e| {
        TRIED.iter().position(|axis| *axis == e.card().axis).unwrap_or(TRIED.len())
    });
    all
}
