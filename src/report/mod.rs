//! Drawing and pages. Computes nothing: a number in a report exists as data elsewhere.
//!
//! A figure is a [`Chart`] first (what stands where, with which label), drawn second, by one set
//! of functions for SVG and PNG alike. A page puts charts, tables and sentences into the skeleton
//! of [`document`]; `numbers` decides how a number is written.

mod axis;
mod calibration_page;
pub mod chart;
mod colours;
mod comparison;
mod diagnosis_page;
pub mod document;
mod figure2;
mod map_page;
mod numbers;
mod residuals;
mod sigma_map;

pub use axis::Axis;
pub use calibration_page::{CalibrationPage, calibration_page};
pub use chart::Chart;
pub use comparison::{comparison_figures, comparison_page};
pub use diagnosis_page::{DiagnosisPage, diagnosis_page, story};
pub use figure2::{Overlay, figure2};
pub use map_page::map_page;
pub use sigma_map::sigma_map;
