//! The judge: from a truth and a verdict to marks, from all marks to scores. Pure functions; nothing
//! here looks at a recording, and nothing was changed after a seal was opened (`judge_sha256`).

mod advice;
mod case;
mod certainty;
mod endpoints;
mod learnt;
mod marks;
mod places;
mod scores;
#[cfg(test)]
mod tests;

pub use advice::{AdviceMarks, AdviceScores, advice_scores, mark_advice};
pub use certainty::{Bin, Certainty};
pub use endpoints::{Endpoint, Level, endpoints_in_words};
pub use learnt::{Learnt, Ratio};
pub use marks::{Marks, Names, ParameterMark, Stated, mark};
pub use scores::{Judged, LEVELS, Rate, Rates, Scores, level, scores, worth};

/// What is hashed into the seal.
pub const JUDGE_SOURCE: [(&str, &str); 10] = [
    ("judge/advice.rs", include_str!("advice.rs")),
    ("judge/case.rs", include_str!("case.rs")),
    ("judge/certainty.rs", include_str!("certainty.rs")),
    ("judge/endpoints.rs", include_str!("endpoints.rs")),
    ("judge/learnt.rs", include_str!("learnt.rs")),
    ("judge/marks.rs", include_str!("marks.rs")),
    ("judge/mod.rs", include_str!("mod.rs")),
    ("judge/places.rs", include_str!("places.rs")),
    ("judge/scores.rs", include_str!("scores.rs")),
    ("verdict.rs", include_str!("../verdict.rs")),
];
