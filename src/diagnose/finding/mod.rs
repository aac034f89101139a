//! From terms and statistics to findings: names, numbers, curves and words.

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
