//! What physics does to a depth image, one cause a file.
//!
//! Light meets the surface, passes the lens, is matched into a disparity and becomes a depth word.
//! Each effect belongs to one [`Stage`] of that path; the driver in `simulate` walks the stages in
//! order and hands every active effect the [`Exposure`] under way. An effect of strength zero
//! changes nothing, and draws only from streams of its own name, so that adding one changes no
//! other.

mod card;
mod exposure;
mod settings;

pub use card::{Card, Parameter, Stage};
pub use exposure::{Draw, Exposure, Instant, KINECT_BASELINE_M, Scope, fill_normal};
pub use settings::{Active, Settings};

/// The forward face of a physical effect: what nature does to the exposure.
pub trait Effect: Send + Sync {
    fn card(&self) -> &'static Card;

    /// Change `exposure` as the effect does with these settings. Called once a frame, at the
    /// card's stage.
    fn forward(&self, settings: &Settings, exposure: &mut Exposure, draw: &Draw);
}

/// One file, one module, one word in the list: what is in the catalogue.
macro_rules! catalogue {
    ($($module:ident :: $name:ident),* $(,)?) => {
        $(mod $module;)*

        /// Every effect, in the order of effects.md.
        pub static CATALOGUE: &[&dyn Effect] = &[$(&$module::$name),*];
    };
}

catalogue! {
    disparity_quantisation::DisparityQuantisation,
    spatial_correlation::SpatialCorrelation,
    vignetting::Vignetting,
}

/// The effect of this id.
pub fn find(id: &str) -> Option<&'static dyn Effect> {
    CATALOGUE.iter().copied().find(|e| e.card().id == id)
}
