//! Judges the answers: [`mark`] one set, [`scores`] all of them; the five endpoints compare the figures
//! chosen in advance with their marks.

mod advice;
mod endpoints;
mod marks;
mod scores;
mod verdict;

pub use advice::{AdviceMarks, mark_advice};
pub use endpoints::{Endpoint, Level, endpoints_in_words};
pub use marks::{Marks, QUESTIONS, mark};
pub use scores::{ByStrength, Rate, Rates, Ratio, Scores, level, scores, word};
pub use verdict::advised_view;
