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
mod shape;

pub use active::{Acting, Active};
pub use ambient_light::ROOM_LUX;
pub use card::{Card, Parameter, Settings, Stage};
pub use draw::{Draw, Scope, fill_normal};
pub use exposure::{Exposure, Instant, KINECT_BASELINE_M};

use crate::terms::Term;
use draw::{chance, logistic, normals};

/// The forward face of a physical effect: what nature does to the exposure.
pub trait Effect: Send + Sync {
    fn card(&self) -> &'static Card;

    /// Change `exposure` as the effect does with these settings. Called once a frame, at the
    /// card's stage, and only when the strength is not the card's identity.
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw);

    /// The fitted terms that stand in place of a formula; the catalogue's effects have none.
    fn terms(&self) -> &[Term] {
        &[]
    }
}

/// The catalogue: to simulate an effect takes one file and one word in this list. What it takes to
/// recognise one is in `crate::docs::catalogue`.
macro_rules! catalogue {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(mod $module;)*

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
