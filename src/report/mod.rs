//! Drawing and pages. Computes nothing: a number in a report exists as data elsewhere.
//!
//! A figure is plain data first ([`Figure2`], [`SigmaMap`]: what stands where, with which label),
//! drawn second, by one function for SVG and PNG alike. The page puts figures and tables together.

pub mod axis;
mod base64;
pub mod colours;
mod comparison;
mod diagnosis_page;
pub mod document;
mod figure2;
mod html;
mod lines;
mod map_page;
pub mod numbers;
mod residual_picture;
pub mod sheet;
mod sigma_map;

pub use axis::Axis;
pub use comparison::{comparison_figures, comparison_page};
pub use diagnosis_page::{DiagnosisPage, Picture, diagnosis_page};
pub use figure2::{Figure2, Group, Overlay, OverlayLine, Point};
pub use html::{CalibrationPage, calibration_page};
pub use lines::{Line, LineFigure};
pub use map_page::map_page;
pub use residual_picture::{residual_png, scale_mm};
pub use sigma_map::{IsoLine, Run, SigmaMap};
