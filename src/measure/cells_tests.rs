//! Bins, and sums of noise whose variance is known.

use super::*;

/// A view of ten frames of white noise.
fn white(view_pixels: f64) -> Context {
    Context {
        frames: 10.0,
        cut_factor: 1.0,
        correlation_sum: 1.0,
        correlation_squares: 1.0,
        temporal_rho: 0.0,
        view_pixels,
    }
}

#[test]
fn a_frontal_view_is_one_bin_and_a_tilted_one_many() {
    assert_eq!(Bins::between(1.0, 1.05).count, 1);
    let bins = Bins::between(0.8, 1.6);
    assert_eq!(bins.count, 15);
    assert_eq!(bins.index(0.8), 0);
    assert_eq!(bins.index(1.6), 14);
    assert_eq!(bins.index(0.1), 0, "outside is clamped");
}

#[test]
fn white_noise_in_time_counts_every_frame_and_frozen_noise_only_one() {
    let context = white(1000.0);
    let base = Sums {
        n: 10_000.0,
        z: 10_000.0,
        e2: 10_000.0,
        p2: 10_000.0,
        pixels: 1000.0,
        within_dof: 9000.0,
        ..Sums::default()
    };
    let white = context.cell(&Sums { within: 9000.0, ..base }).unwrap();
    assert!((white.n_effective - 10_000.0).abs() < 1.0, "{white:?}");
    let frozen = context.cell(&Sums { within: 0.0, ..base }).unwrap();
    assert!((frozen.n_effective - 1000.0).abs() < 1.0, "{frozen:?}");
    // With unit variance: the mean over 10,000 readings, and over the 1000 different ones.
    assert!((white.mean_std_error_m - 0.01).abs() < 1e-4, "{white:?}");
    assert!((frozen.mean_std_error_m - 1000f64.powf(-0.5)).abs() < 1e-4, "{frozen:?}");
    // Ten frames that jump as a whole with a variance of 0.12 leave a tenth of it in the mean; noise
    // adds 9 to their sum of squares.
    let between = 1000.0 * 9.0 * 0.12 + 9.0;
    let jumps = Sums { within: 9000.0, between, ..base };
    let shared = context.shared_by_a_frame(&jumps);
    let jumping = context.cell(&Sums { shared, ..jumps }).unwrap();
    let expected = 0.012 + (1.0 - 0.108) * 1e-4;
    assert!((jumping.mean_std_error_m.powi(2) - expected).abs() < 1e-6, "{jumping:?}");
}

/// A tilted view of fifteen bins of white noise, each with its own frames' means: 9 of their sum of squares are by
/// chance in every bin, and nothing is shared.
#[test]
fn bins_without_shifts_keep_all_their_variance() {
    let context = white(15_000.0);
    let bin = Sums {
        n: 1000.0,
        z: 1000.0,
        e2: 1000.0,
        p2: 1000.0,
        pixels: 100.0,
        within: 900.0,
        within_dof: 900.0,
        bins: 1.0,
        ..Sums::default()
    };
    let mut whole = Sums::default();
    for k in 0..15 {
        // By chance more in one bin, and less in the next.
        let between = 9.0 + if k % 2 == 0 { 4.0 } else { -4.0 };
        let mine = Sums { between, ..bin };
        whole.merge(&Sums { shared: context.shared_by_a_frame(&mine), ..mine });
    }
    let sigma = context.cell(&whole).unwrap().spread.spatial_m;
    assert!((sigma - 1.0).abs() < 1e-3, "{sigma}");
}

/// Compares with the plain double sum.
#[test]
fn the_mean_correlation_is_the_mean_over_pairs() {
    for (rho, n) in [(0.0, 5), (0.3, 2), (0.6, 7), (0.8, 4)] {
        let mut sum = 0.0;
        for i in 0..n {
            for j in 0..i {
                sum += f64::powi(rho, i - j);
            }
        }
        let mean = 2.0 * sum / f64::from(n * (n - 1));
        assert!((mean_correlation(rho, f64::from(n)) - mean).abs() < 1e-12, "{rho} {n}");
    }
}
