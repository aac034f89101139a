//! What a search decides by.

use crate::diagnose::views::learnt::Learnt;
use crate::terms::Basis;

/// A later term must be this large beside the largest, root mean square by root mean square.
const MIN_OF_LARGEST: f64 = 0.06;
/// A pattern that stands still must be, in square, so much more than what a fit to nothing but the
/// pixels' own errors would make: seven times, for the best of many and for views that cover little
/// of the picture.
const CLEARLY_FIXED: f64 = 50.0;

/// How a search decides.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// Chance that noise alone is taken for a term.
    pub level: f64,
    /// Precision of a coefficient nothing is known about, in its own unit.
    pub prior: f64,
    /// A name must explain this share of what the best curve does.
    pub adequacy: f64,
    /// And this share of what the best curve on its own axis does: what that one sees beyond is no rest
    /// of another cause.
    pub own_axis_adequacy: f64,
    /// Of curves without a name, take the one on which the views agree: what stands still on the target is
    /// no map of the picture. Where curves are fitted anew together, the largest is a better beginning.
    pub agreed: bool,
    pub max_terms: usize,
    /// Constant error of every pixel, px, and pixels of the picture: a pattern that stands still
    /// in the picture must be larger than what these errors make by chance.
    pub fixed: Option<(f64, f64)>,
    /// Judge gains by what noise alone would have brought.
    pub calibrated: bool,
    /// Views that the model was learnt from, where these views are not among them: its own error is
    /// theirs scattered about their mean, and stands beside the error of these.
    pub learnt_from: Option<Learnt>,
}

impl Rules {
    /// Root mean square that a fit must have beside that of the `largest` term.
    pub fn min_rms(&self, basis: &Basis, largest: f64) -> f64 {
        let still = |(fixed, pixels): (f64, f64)| {
            fixed * (CLEARLY_FIXED * basis.count() as f64 / pixels).sqrt()
        };
        let still = self.fixed.filter(|_| basis.is_of_picture()).map_or(0.0, still);
        still.max(MIN_OF_LARGEST * largest)
    }
}
