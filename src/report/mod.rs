//! Charts and HTML pages. Nothing is computed here: every number in a report also exists as data elsewhere.
//!
//! A figure is first a [`Chart`] (what stands where, with which label). One set of functions then draws
//! it as SVG or PNG. A page puts charts, tables and sentences into the skeleton of [`document`];
//! `numbers` formats the numbers. A page, figure or chart fails only if a picture cannot be drawn.

mod axis;
mod calibration_page;
pub mod chart;
mod colours;
mod comparison;
mod coverage;
mod diagnosis_page;
pub mod document;
mod map_page;
mod metrics_page;
mod numbers;
mod overlay;
mod residuals;
mod sigma_map;
mod slices;
mod trajectories;

pub use axis::Axis;
pub use calibration_page::{CalibrationPage, calibration_page};
pub use chart::Chart;
pub use comparison::{comparison_charts, comparison_page};
pub use diagnosis_page::{DiagnosisPage, Step, called, diagnosis_page, story, subject};
pub use document::Origin;
pub use map_page::{MapPage, map_page};
pub use metrics_page::metrics_page;
pub use overlay::Overlay;
pub use sigma_map::sigma_map;
pub use slices::figure2;
pub use trajectories::{Against, evaluation_page};
