//! Is there a shadow beside the target, in all views on one side, and as wide as it must be?

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::diagnosis::Curve;
use super::shadow::{Shadow, Side};

/// Bands without a measurement beside the target.
#[derive(Debug, Clone)]
pub struct Band {
    /// Beside the left border; else the right.
    pub left: bool,
    /// As wide as the geometry has it.
    pub lawful: bool,
    /// Of the expected width, and its standard error.
    pub share: [f64; 2],
    /// Sum of squares explained by a share of the expected width, and by one width everywhere,
    /// over the squares of what a width is known to.
    pub gain: [f64; 2],
    pub p: f64,
    pub curve: Curve,
}

/// A border is known to this, px.
const BORDER_PX: f64 = 0.7;
/// Fewer views show no rule, and a narrower band no shadow.
const FEWEST_VIEWS: usize = 3;
const LEAST_EXPECTED_PX: f64 = 1.0;
/// The other side has less than this share of it.
const OTHER_SIDE: f64 = 0.4;
/// A lawful shadow's share of the baseline: half-lit fringes and mixed pixels make it narrower.
const LAWFUL: [f64; 2] = [0.4, 1.4];
/// A name must explain this share of what the best curve does.
const ADEQUATE: f64 = 0.6;

struct Law {
    share: f64,
    std_error: f64,
    views: usize,
}

fn law(sides: &[Side]) -> Option<Law> {
    let n = sides.len() as f64;
    if sides.len() < FEWEST_VIEWS {
        return None;
    }
    let square: f64 = sides.iter().map(|s| s.expected_px.powi(2)).sum();
    let share = sides.iter().map(|s| s.expected_px * s.width_px).sum::<f64>() / square;
    let off = |s: &Side| (s.expected_px * (s.width_px - share * s.expected_px)).powi(2);
    let scatter = sides.iter().map(off).sum::<f64>() * n / (n - 1.0);
    let std_error = (scatter.sqrt() / square).max(BORDER_PX / square.sqrt());
    Some(Law { share, std_error, views: sides.len() })
}

/// The band that the views agree on, if there is one at this level.
pub fn band(shadows: &[Shadow], level: f64) -> Option<Band> {
    let seen = |side: fn(&Shadow) -> Option<Side>| -> Vec<Side> {
        let usable = |s: &Side| s.expected_px > LEAST_EXPECTED_PX;
        shadows.iter().filter_map(side).filter(usable).collect()
    };
    let (left, right) = (seen(|s| s.left), seen(|s| s.right));
    let share = |sides: &[Side]| law(sides).map_or(0.0, |l| l.share);
    let on_left = share(&left) >= share(&right);
    let (sides, others) = if on_left { (left, right) } else { (right, left) };
    let found = law(&sides)?;
    let t = StudentsT::new(0.0, 1.0, (found.views - 1) as f64).ok()?;
    // Two sides were looked at.
    let p = (2.0 * t.sf(found.share / found.std_error)).min(1.0);
    if p > level || found.share * mean(&sides, |s| s.expected_px) < BORDER_PX {
        return None;
    }
    let one_sided = share(&others) < OTHER_SIDE * found.share;
    let width = mean(&sides, |s| s.width_px);
    let explained = |of: &dyn Fn(&Side) -> f64| {
        let left: f64 = sides.iter().map(|s| (s.width_px - of(s)).powi(2)).sum();
        let all: f64 = sides.iter().map(|s| s.width_px.powi(2)).sum();
        0.5 * (all - left) / BORDER_PX.powi(2)
    };
    let gain = [explained(&|s| found.share * s.expected_px), explained(&|_| width)];
    let lawful =
        one_sided && (LAWFUL[0]..LAWFUL[1]).contains(&found.share) && gain[0] > ADEQUATE * gain[1];
    Some(Band {
        left: on_left,
        lawful,
        share: [found.share, found.std_error],
        gain,
        p,
        curve: curve(&sides, found.share),
    })
}

fn mean(sides: &[Side], of: fn(&Side) -> f64) -> f64 {
    sides.iter().map(of).sum::<f64>() / sides.len().max(1) as f64
}

fn curve(sides: &[Side], share: f64) -> Curve {
    let mut sides = sides.to_vec();
    sides.sort_by(|a, b| a.expected_px.total_cmp(&b.expected_px));
    Curve {
        x_label: "disparity from the target's border to what is behind, px".into(),
        y_label: "width without a measurement beside the border, px".into(),
        x: sides.iter().map(|s| s.expected_px).collect(),
        y: sides.iter().map(|s| s.width_px).collect(),
        y_std_error: vec![BORDER_PX; sides.len()],
        model: sides.iter().map(|s| share * s.expected_px).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shadows(width: impl Fn(f64) -> [f64; 2]) -> Vec<Shadow> {
        let side = |width_px, expected_px| Some(Side { width_px, expected_px, rows: 100 });
        (4..14)
            .map(|k| {
                let expected = 2.0 * f64::from(k);
                let [left, right] = width(expected).map(f64::round);
                Shadow { left: side(left, expected), right: side(right, expected) }
            })
            .collect()
    }

    #[test]
    fn a_band_is_a_shadow_when_it_is_on_one_side_and_as_wide_as_it_must_be() {
        let found = band(&shadows(|e| [0.9 * e, 0.0]), 1e-3).unwrap();
        assert!(found.lawful && found.left && (found.share[0] - 0.9).abs() < 0.05);
        assert!(!band(&shadows(|e| [0.0, e]), 1e-3).unwrap().left);
        assert!(!band(&shadows(|e| [e, 0.9 * e]), 1e-3).unwrap().lawful, "on both sides");
        assert!(!band(&shadows(|e| [0.0, 3.0 * e]), 1e-3).unwrap().lawful, "too wide");
        assert!(band(&shadows(|_| [0.0, 0.0]), 1e-3).is_none());
        assert!(band(&shadows(|e| [f64::from(e > 25.0), 0.0]), 1e-3).is_none(), "a stray pixel");
    }
}
