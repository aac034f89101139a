//! Drawing and pages. Computes nothing: a number in a report exists as data elsewhere.
//!
//! A figure is a [`Chart`] first (what stands where, with which label), drawn second, by one set
//! of functions for SVG and PNG alike. A page puts charts, tables and sentences into the skeleton
//! of [`document`]; `numbers` decides how a number is written. The one error of a page, a figure or a
//! chart is that a picture cannot be drawn.

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
