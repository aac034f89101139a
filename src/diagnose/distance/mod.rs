//! Laws of distance error, where the distance was measured by other means.

pub mod laws;
pub mod reference;
pub mod referenced_view;
pub mod warm_up;
