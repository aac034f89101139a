//! A finding that sigma is off, next to other findings: laws of depth or tilt are folded into it, and it does
//! not rank before a cause that it merely echoes.

use super::diagnosis::{Finding, Status};
use super::views::field::Field;
use crate::terms::{Axis, Statistic};

/// Folds weaker laws of depth or tilt alone into the finding that sigma is off: they are the rest of the
/// same misfit. Their terms and nats go to that finding.
pub(super) fn fold_into_sigma(found: &mut Vec<Finding>) {
    let Some(at) = found.iter().position(|f| f.status == Status::Recalibrate) else { return };
    let mut sigma = found.remove(at);
    let (rest, others): (Vec<Finding>, Vec<Finding>) =
        found.drain(..).partition(|f| of_sigma_alone(f) && f.share < sigma.share);
    *found = others;
    for f in rest {
        sigma.share += f.share;
        sigma.terms.extend(f.terms);
        sigma.covariance.extend(f.covariance);
    }
    found.insert(at.min(found.len()), sigma);
}

/// Drops the finding that sigma is off where a noisier frame accounts for at least half of it; then only the
/// frame is reported.
pub(super) fn forget_noise_of_frames(
    found: &mut Vec<Finding>,
    textures: &[Finding],
    fields: &[Field],
) {
    let of_frame = |f: &&Finding| f.statistic == Statistic::Variance && f.axis == Axis::Frame;
    let frame = textures.iter().find(of_frame);
    let log = frame.and_then(|f| f.value("log_variance"));
    let frames = fields.iter().map(|f| f.frames.len()).max().unwrap_or(1);
    let own = log.map_or(0.0, |log| log.exp_m1() / frames as f64);
    let echo = |off: f64| off * own > 0.0 && own.abs() > HALF * off.abs();
    found.retain(|f| f.status != Status::Recalibrate || !echo(-excess(f)));
}

fn of_sigma_alone(f: &Finding) -> bool {
    let axis = matches!(f.axis, Axis::Z | Axis::Theta);
    f.statistic == Statistic::Variance && axis && f.effect.is_none_or(|id| id == "range-exponent")
}

/// Effects that add to the spread of one frame, and so to a sigma calibrated with them present.
const SPREADS: [&str; 6] = [
    "fixed-pattern-noise",
    "frozen-noise",
    "disparity-quantisation",
    "depth-rounding",
    "column-banding",
    "row-noise",
];

fn spreads(f: &Finding) -> bool {
    // The size of a texture in some views is that in these; the size of a mean error is that in all views.
    let of_all =
        f.of_some.is_none() || f.statistic == Statistic::Bias && f.axis != Axis::EdgeDistance;
    let named = matches!(f.status, Status::Named | Status::OneOf) && of_all;
    named && (f.statistic == Statistic::Bias || f.effect.is_some_and(|id| SPREADS.contains(&id)))
}

/// Reduces the finding that sigma is too large to the variance that the named causes do not account for:
/// sigma was calibrated with them present.
pub(super) fn echoes(found: &mut [Finding]) {
    let explained: f64 = found.iter().filter(|f| spreads(f)).map(|f| f.size.sigma.powi(2)).sum();
    let largest = found.iter().filter(|f| spreads(f)).map(|f| f.share).fold(0.0, f64::max);
    for f in found.iter_mut().filter(|f| f.status == Status::Recalibrate) {
        let too_much = excess(f);
        if too_much > 0.0 && explained > 0.0 {
            f.share *= (1.0 - explained / too_much).max(0.0);
            if explained > HALF * too_much {
                f.share = f.share.min(0.99 * largest);
            }
        }
    }
}

/// Share of sigma's error from which on a cause accounts for it.
const HALF: f64 = 0.5;

/// Excess of the model's variance over the measured one, in units of the model's; negative where sigma is
/// too small.
fn excess(f: &Finding) -> f64 {
    let Some(curve) = f.curve.as_ref().filter(|c| !c.model.is_empty()) else { return 0.0 };
    let mean = curve.model.iter().map(|ratio| ratio * ratio).sum::<f64>();
    1.0 - mean / curve.model.len() as f64
}

#[cfg(test)]
mod tests {
    use std::slice::from_ref;

    use super::*;
    use crate::diagnose::finding::other_findings::{named, nameless};
    use crate::diagnose::finding::parameters::one;
    use crate::diagnose::verdict::shares;
    use crate::diagnose::{Curve, Size};
    use crate::plane::Plane;

    fn recalibrate(ratio: f64) -> Finding {
        let curve = Curve { model: vec![ratio; 8], ..Curve::default() };
        Finding {
            status: Status::Recalibrate,
            effect: None,
            share: 900.0,
            curve: Some(curve),
            ..named("range-exponent", Statistic::Variance, Axis::Z)
        }
    }

    fn bowl(sigma: f64) -> Finding {
        Finding {
            share: 100.0,
            size: Size { mm: 1.0, sigma },
            ..named("radial-disparity-bias", Statistic::Bias, Axis::Radius)
        }
    }

    /// A smaller law is folded into the larger misfit of sigma, but not the other way round.
    #[test]
    fn a_law_of_the_depth_beside_a_larger_misfit_of_sigma_is_part_of_it() {
        for (nats, left) in [(100.0, 1), (2000.0, 2)] {
            let exponent =
                Finding { share: nats, ..named("range-exponent", Statistic::Variance, Axis::Z) };
            let mut found = vec![exponent, recalibrate(1.2)];
            fold_into_sigma(&mut found);
            assert_eq!(found.len(), left);
            assert_eq!(found.iter().map(|f| f.share).sum::<f64>(), 900.0 + nats);
        }
    }

    /// First a sigma calibrated with a bias of half its size present, then one that is too small, which no
    /// bias explains.
    #[test]
    fn the_echo_of_a_cause_never_comes_before_it() {
        let mut found = vec![recalibrate(0.75f64.sqrt()), bowl(0.5)];
        echoes(&mut found);
        shares(&mut found);
        assert_eq!(found[0].effect, Some("radial-disparity-bias"));
        assert!(found[1].share < 1e-9, "{}", found[1].share);
        let mut found = vec![recalibrate(1.3), bowl(0.5)];
        echoes(&mut found);
        shares(&mut found);
        assert_eq!(found[0].status, Status::Recalibrate);
    }

    /// One frame of four with 1.46 times the variance of the others makes all 1.12 times as large.
    #[test]
    fn a_noisier_frame_is_no_sigma_that_is_off() {
        let frame = |axis| {
            let parameters = one("log_variance", 0.38, 0.01);
            Finding { parameters, ..nameless(Statistic::Variance, axis) }
        };
        let (own, row) = (frame(Axis::Frame), frame(Axis::Row));
        let field = Field {
            frames: vec![(0.0, 0.0); 4],
            ..Field::unseen(Plane::tilted(1.0, 0.0, 0.0), 43.5, [1, 1], vec![0])
        };
        for (ratio, texture, left) in
            [(1.05, &own, 0), (1.2, &own, 1), (0.95, &own, 1), (1.05, &row, 1)]
        {
            let mut found = vec![recalibrate(ratio)];
            forget_noise_of_frames(&mut found, from_ref(texture), from_ref(&field));
            assert_eq!(found.len(), left, "{ratio}");
        }
    }
}
