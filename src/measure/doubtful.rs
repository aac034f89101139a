//! Detects depth bins of a view that show something other than the target's noise.
//!
//! Noise changes little from one bin of depth to the next (5 % in depth), so a bin that scatters far more
//! than those before it, or is off the plane as a whole, sees something else: a wall behind the board's far
//! edge, a hand at its rim.

use super::cells::Cell;

/// Allowed ratio of a bin's scatter, in inverse depth, to that of its neighbours. Noise ~ z^2 gives 1, Eq. 1
/// near 0.5 m gives 0.9, and lens errors of Herrera's real views reach 1.7 ...
const TIMES_NEIGHBOURS: f64 = 2.0;
/// ... plus this many of its own standard errors.
const STANDARD_ERRORS: f64 = 3.0;
/// Allowed offset of a bin's mean, standard deviations: none of Herrera's real views exceeds it.
const MEAN_SIGMAS: f64 = 2.0;
/// Bins towards the middle of the view with whose median a bin is compared.
const COMPARED: usize = 3;

/// One bin and the mean of its axial residual, m.
pub(super) struct Bin {
    pub cell: Cell,
    pub mean_m: f64,
}

/// Why each bin is doubtful; `None` for those that show the target's noise. Compared from the largest bin
/// outwards with trusted ones only, so that a doubtful one never excuses the next.
pub(super) fn doubts(bins: &[Bin]) -> Vec<Option<String>> {
    let mut doubts: Vec<Option<String>> = bins.iter().map(|_| None).collect();
    let Some(middle) = (0..bins.len()).max_by_key(|&k| bins[k].cell.n) else { return doubts };
    let outwards: [Box<dyn Iterator<Item = usize>>; 2] =
        [Box::new(middle + 1..bins.len()), Box::new((0..middle).rev())];
    for side in outwards {
        let mut trusted = vec![roughness(&bins[middle].cell)];
        for k in side {
            doubts[k] = doubt(&bins[k], &trusted);
            if doubts[k].is_none() {
                trusted.push(roughness(&bins[k].cell));
            }
        }
    }
    doubts
}

/// Sigma in inverse depth, 1/m, which is similar in neighbouring bins.
fn roughness(cell: &Cell) -> f64 {
    cell.spread.spatial_m / (cell.z_m * cell.z_m)
}

fn doubt(bin: &Bin, trusted: &[f64]) -> Option<String> {
    let mut near: Vec<f64> = trusted.iter().rev().take(COMPARED).copied().collect();
    near.sort_by(f64::total_cmp);
    let usual_m = near[near.len() / 2] * bin.cell.z_m * bin.cell.z_m;
    let sigma = bin.cell.spread.spatial_m;
    let own_sd = (sigma * sigma - bin.mean_m * bin.mean_m).max(0.0).sqrt();
    let scatters = sigma > TIMES_NEIGHBOURS * usual_m + STANDARD_ERRORS * bin.cell.std_error_m;
    let shifted = bin.mean_m.abs() > MEAN_SIGMAS * own_sd.max(usual_m);
    (scatters || shifted).then(|| {
        format!(
            "its bin at {:.2} m was left out: it is off the plane by {:.1} mm on average and \
             scatters {:.1} times as much as the bins beside it, so something else is seen \
             there; draw the target's region tighter in view.json",
            bin.cell.z_m,
            1000.0 * bin.mean_m,
            sigma / usual_m
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::cells::Spread;
    use super::*;

    fn bin(z_m: f64, sigma: f64, mean_m: f64, n: usize) -> Bin {
        let spread =
            Spread { spatial_m: sigma, temporal_m: None, total_m: sigma, perpendicular_m: sigma };
        let std_error_m = 0.05 * sigma;
        let cell = Cell {
            z_m,
            spread,
            std_error_m,
            mean_std_error_m: 0.0,
            shift_std_error_m: 0.0,
            n,
            n_effective: 200.0,
            n_effective_temporal: 1.0,
            dropouts: 0,
            cut: 0,
        };
        Bin { cell, mean_m }
    }

    #[test]
    fn noise_that_grows_as_the_square_of_depth_is_trusted() {
        let bins: Vec<Bin> = (0..20)
            .map(|k| {
                let z = 1.05f64.powi(k);
                bin(z, 0.002 * z * z, 0.5 * 0.002 * z * z, 1000)
            })
            .collect();
        assert!(doubts(&bins).iter().all(Option::is_none));
    }

    #[test]
    fn bins_that_see_a_wall_are_doubted_and_do_not_excuse_the_next() {
        let mut bins: Vec<Bin> = (0..10).map(|k| bin(2.0, 0.008, 0.0, 1000 - k)).collect();
        bins[7] = bin(2.4, 0.012 * 5.8, 0.02, 400);
        bins[8] = bin(2.5, 0.013 * 4.0, -0.03, 400);
        // Scatters like its neighbours about its own mean, which is 3 sigma behind the plane.
        bins[0] = bin(1.9, 0.0253, 0.024, 400);
        let doubted = doubts(&bins);
        let which: Vec<usize> = (0..10).filter(|&k| doubted[k].is_some()).collect();
        assert_eq!(which, [0, 7, 8]);
        assert!(doubted[7].as_ref().unwrap().contains("view.json"));
    }
}
