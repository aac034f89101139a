//! Lattices among drawn words, and none where there are none.

use super::*;
use crate::rng::Seed;
use crate::simulate::kinect_v1;
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

fn words(step_px: f64, rounding: f64) -> RawHistogram {
    let mut rng = Seed(1).stream("lattice");
    let mut words = RawHistogram::default();
    let sensor = kinect_v1(1);
    for _ in 0..200_000 {
        let z: f64 = rng.random_range(0.8..3.0);
        let noise: f64 = StandardNormal.sample(&mut rng);
        let mut d = 43.5 / z + 0.08 * noise;
        if step_px > 0.0 {
            d = (d / step_px).round() * step_px;
        }
        let z = 43.5 / d;
        let z = if rounding > 0.0 { (z / rounding).round() * rounding } else { z };
        words.0[usize::from(sensor.code.raw(z))] += 1;
    }
    words
}

/// A matcher's steps of 1.28 to 13.4 words, each stored in the nearest word; and the words' own step.
#[test]
fn raw_words_show_steps_that_are_no_whole_number_of_them() {
    let word_px = 0.125;
    let (offset, slope) = (1100.0 * word_px / 43.5, -word_px / 43.5);
    let code = DepthCode::Disparity { offset, slope, invalid: 2047 };
    let sensor = Sensor { code, ..kinect_v1(1) };
    let mut rng = Seed(4).stream("lattice/raw");
    let mut found = |step_px: f64| {
        let mut words = RawHistogram::default();
        for _ in 0..100_000 {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let mut d = rng.random_range(14.0..44.0) + 0.08 * noise;
            if step_px > 0.0 {
                d = (d / step_px).round() * step_px;
            }
            words.0[((d / 43.5 - offset) / slope).round() as usize] += 1;
        }
        words.lattice(&sensor, 43.5)
    };
    for step_px in [0.16, 0.2, 0.25, 1.0 / 3.0, 0.5, 0.9125, 1.2125, 1.675] {
        let found = found(step_px);
        let step = found.expect("a step");
        let near = (step.size / step_px - 1.0).abs() < 5e-3;
        assert!(near && !step.is_of_depth, "{step_px}: {step:?}");
        assert!(step.p.is_some_and(|p| p < 1e-4), "{step:?}");
    }
    let own = found(0.0).unwrap();
    assert!((own.size / word_px - 1.0).abs() < 1e-9 && own.p.is_none(), "{own:?}");
}

/// Six targets of two words each, and single strays anywhere: two neighbours a target hold any step's phase.
#[test]
fn rare_words_are_no_evidence_of_a_step() {
    let mut rng = Seed(5).stream("lattice/strays");
    for _ in 0..6 {
        let mut words = RawHistogram::default();
        for _ in 0..6 {
            let middle = rng.random_range(620..900);
            for word in [middle, middle + 1] {
                words.0[word] += rng.random_range(20_000..40_000);
            }
        }
        (0..200).for_each(|_| words.0[rng.random_range(600..920)] += 1);
        let occurring = words.occurring();
        assert_eq!(super::steps_of_words(&occurring), None);
    }
}

#[test]
fn steps_of_matcher_and_driver_are_found_and_none_where_there_are_none() {
    let sensor = kinect_v1(1);
    let found = words(0.125, 0.0).lattice(&sensor, 43.5).unwrap();
    assert!((found.size / 0.125 - 1.0).abs() < 2e-3 && !found.is_of_depth, "{found:?}");
    let found = words(0.0, 0.001).lattice(&sensor, 43.5).unwrap();
    assert_eq!((found.size, found.is_of_depth), (0.001, true));
    for rounding in [0.00045, 0.000907, 0.00121, 0.0123] {
        let found = words(0.0, rounding).lattice(&sensor, 43.5);
        let step = found.expect("a step that is no whole number of units");
        assert!((step.size / rounding - 1.0).abs() < 1e-4, "{rounding}: {step:?}");
        assert!(step.is_of_depth && step.p.is_some_and(|p| p < 1e-9));
    }
    assert_eq!(words(0.0, 0.0).lattice(&sensor, 43.5), None);
}

/// Targets at a few words, one of which was decided by chance in the rounding to 0.2 mm.
#[test]
fn a_coarse_step_shows_in_few_words() {
    let sensor = kinect_v1(2);
    let counts = [10, 75, 382, 75, 66, 5, 75, 255, 35, 4, 158];
    let words = [3398, 3625, 3884, 4183, 4531, 4943, 5437, 6042, 6797, 7768, 9063];
    let mut histogram = RawHistogram::default();
    let readings = words.iter().zip(counts);
    histogram.count(readings.flat_map(|(word, n)| std::iter::repeat_n(*word, 1000 * n)));
    assert!(histogram.is_few());
    let found = histogram.lattice(&sensor, 21.75).expect("a step");
    assert!((found.size / 2.0 - 1.0).abs() < 1e-3 && !found.is_of_depth, "{found:?}");
}
