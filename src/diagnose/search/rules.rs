//! Rules that a search decides by.

use crate::diagnose::views::learnt::Learnt;
use crate::terms::Basis;

/// Smallest root mean square of a later term, as a share of the largest term's.
const MIN_OF_LARGEST: f64 = 0.06;
/// Smallest mean square of an image-fixed pattern over that of a fit to the pixels' own errors alone:
/// seven times in amplitude, to allow for the best of many and for views that cover little of the
/// image.
const CLEARLY_FIXED: f64 = 50.0;

/// Thresholds and options of a search.
#[derive(Debug, Clone, Copy)]
pub struct Rules {
    /// Chance that noise alone is taken for a term.
    pub level: f64,
    /// Prior precision of a coefficient, in its own unit.
    pub prior: f64,
    /// Share of the best curve's gain that a name must reach.
    pub adequacy: f64,
    /// The same for the best curve on the name's own axis: what that curve explains beyond the name is
    /// not left over from another cause.
    pub own_axis_adequacy: f64,
    /// Among nameless curves, take the one on which the views agree: a pattern fixed to the target is
    /// no map of the image. Where curves are later refitted together, the largest gain is the better
    /// start.
    pub agreed: bool,
    pub max_terms: usize,
    /// Standard deviation of the pixels' fixed errors, px, and the number of pixels covered: an
    /// image-fixed pattern must be larger than these errors produce by chance.
    pub fixed: Option<(f64, f64)>,
    /// Whether gains are judged against their null distribution.
    pub calibrated: bool,
    /// The views that the model was learnt from, where these are others: the model's own error is the
    /// scatter of those views about their mean, and adds to the error of these.
    pub learnt_from: Option<Learnt>,
}

/// Share of the level for terms beside others, whose formulas' misfits look like further terms: of three
/// needless ones in 300 development sets at the full level, one remains at this share.
pub const LATER_LEVEL: f64 = 0.3;

impl Rules {
    /// The rules for a term beside this many others.
    pub fn beside(self, others: usize) -> Self {
        if others > 0 { self.later() } else { self }
    }

    /// The rules for terms beside others.
    pub fn later(self) -> Self {
        Rules { level: LATER_LEVEL * self.level, ..self }
    }

    /// Smallest root mean square of a fit, given that of the `largest` term.
    pub fn min_rms(&self, basis: &Basis, largest: f64) -> f64 {
        let still = |(fixed, pixels): (f64, f64)| {
            fixed * (CLEARLY_FIXED * basis.count() as f64 / pixels).sqrt()
        };
        let still = self.fixed.filter(|_| basis.is_of_picture()).map_or(0.0, still);
        still.max(MIN_OF_LARGEST * largest)
    }
}
