//! Physical effects on a depth image, one cause per file.
//!
//! Light hits the surface, passes the lens, is matched into a disparity and becomes a raw depth value. Each
//! effect belongs to one [`Stage`] of that path; the driver in `simulate` walks the stages in order and
//! passes the [`Exposure`] in progress to every active effect. An effect at its card's identity does
//! nothing, and every effect draws only from random streams of its own name, so that adding one changes no
//! other.

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
pub use traces::{Bounds, Flat, Inverse, Smallest};

use crate::camera::Camera;
pub use crate::terms::ROOM_LUX;
use crate::terms::{Basis, Statistic, Term};
use draw::{chance, normals};
use fitted::{greatest, slope_in_square};

/// Anything with a card; `catalogue!` gives each effect the `CARD` of its file.
pub trait Carded {
    fn card(&self) -> &'static Card;
}

/// A physical effect: what it does to an exposure, and how it shows in a recording. Effects without
/// [`Effect::shapes`] show in textures, losses, edges or reference distances, and are recognised by
/// dedicated measurements.
pub trait Effect: Carded + Send + Sync {
    /// Applies the effect to `exposure`. Called once per frame, at the card's stage, and only when the
    /// strength is not the card's identity.
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw);

    /// Candidate basis functions: of the mean, px of disparity, or of the log variance, depending on the
    /// card's statistic. A diagnosis tries them all.
    fn shapes(&self, _: &Bounds) -> Vec<Basis> {
        Vec::new()
    }

    /// Prior standard deviation of coefficient number `k` of one of its shapes, in its unit: the card's,
    /// unless it depends on these. `flat` is what is stated about the target.
    fn usual(&self, _shape: &Basis, _k: usize, _flat: Option<&Flat>) -> f64 {
        self.card().usual
    }

    /// Whether a shape with these coefficients can be this effect, given what is stated about the target.
    fn agrees_with(&self, _flat: Option<&Flat>, _shape: &Basis, _coefficients: &[f64]) -> bool {
        true
    }

    /// Parameters of a fitted shape.
    fn estimates(&self, _: &Fitted) -> Vec<Estimate> {
        Vec::new()
    }

    /// The term of an effect of these parameters, if it is one.
    fn term(&self, _: &Settings, _: &Camera) -> Option<Term> {
        None
    }

    /// What removes the effect from a depth image; `None` for what is no bias of the sensor.
    fn inverse(&self, settings: &Settings, camera: &Camera) -> Option<Inverse> {
        let term = self.term(settings, camera)?;
        term.is_sensor_bias().then_some(Inverse::Term(term))
    }

    /// How to report the smallest detectable size of the effect.
    fn smallest(&self, _: &Bounds) -> Option<Smallest> {
        None
    }
}

/// Default prior standard deviation, px: larger errors of a matcher are gross ones.
pub const USUAL_PX: f64 = 1.0;

/// The catalogue: an effect takes one file and one line in this list (`crate::docs::catalogue`).
macro_rules! catalogue {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(mod $module;)*

        $(impl Carded for $module::$name {
            fn card(&self) -> &'static Card {
                &$module::CARD
            }
        })*

        /// Every effect, in the order of `crate::docs::catalogue`.
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

/// Finds the effect of this id.
pub fn find(id: &str) -> Option<&'static dyn Effect> {
    CATALOGUE.iter().copied().find(|e| e.card().id == id)
}

/// The effects that change this statistic.
pub fn that_change(statistic: Statistic) -> impl Iterator<Item = &'static dyn Effect> {
    CATALOGUE.iter().copied().filter(move |e| e.card().statistic == statistic.id())
}
