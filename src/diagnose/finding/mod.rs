//! Turns terms and statistics into findings: names, numbers, curves and text.

pub mod along;
pub mod contest;
pub mod findings;
pub mod form;
pub mod naming;
pub mod next_view;
pub mod other_findings;
pub mod outlook;
pub mod parameters;
pub mod pixels;
pub mod scene;
pub mod shape;
