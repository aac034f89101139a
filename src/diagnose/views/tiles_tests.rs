//! Tiles with some readings lost.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::plane::Plane;
use crate::rng::Seed;
use crate::simulate::kinect_v1;

const FRAMES: usize = 4;
const SIGMA: f32 = 0.1;

/// A field in which a share `kept` of every pixel's readings is kept; the others are lost at random.
fn field(camera: &Camera, kept: f64) -> Field {
    let inside = |i: &u32| {
        let (u, v) = (*i as usize % camera.width, *i as usize / camera.width);
        (200..400).contains(&u) && (100..300).contains(&v)
    };
    let pixels = (0..(camera.width * camera.height) as u32).filter(inside).collect();
    let size = [camera.width, camera.height];
    let mut field = Field::unseen(Plane::tilted(1.5, 0.0, 0.0), 43.5, size, pixels);
    field.sigma = vec![SIGMA; field.pixels.len()];
    field.frames = vec![(0.0, 0.0); FRAMES];
    let mut rng = Seed(3).stream("tiles/lost");
    for k in 0..field.pixels.len() {
        let mut readings: Vec<f32> = Vec::new();
        for _ in 0..FRAMES {
            let normal: f32 = StandardNormal.sample(&mut rng);
            if rng.random::<f64>() < kept {
                readings.push(SIGMA * normal);
            }
        }
        let n = readings.len() as f32;
        field.count[k] = readings.len() as u16;
        field.measured[k] = readings.len() as u16;
        field.mean[k] = readings.iter().sum::<f32>() / n;
        field.square[k] = readings.iter().map(|e| e * e).sum::<f32>() / n;
    }
    field
}

/// The noise is as large as where nothing is lost, and is weighted by the pairs of readings there are.
#[test]
fn lost_readings_make_the_noise_no_smaller() {
    let camera = kinect_v1(1).camera;
    for kept in [1.0, 0.5, 0.2] {
        let (_, tiles) = tiles(&field(&camera, kept), &camera, &camera.rays());
        let seen = tiles.iter().filter(|t| t.temporal.is_finite());
        let sums = seen.fold([0.0; 2], |[square, n], t| {
            let counts = t.pixels * t.repeated;
            [square + counts * t.temporal, n + counts]
        });
        let unbiased = sums[0] / sums[1] * FRAMES as f64 / (FRAMES as f64 - 1.0);
        // 40,000 pixels, with a tenth of the pairs where a fifth of the readings is left.
        let ratio = unbiased / f64::from(SIGMA).powi(2);
        assert!((ratio - 1.0).abs() < 0.05, "{kept}: {ratio}");
        // A pixel that is read n times has n - 1 differences.
        let lost = 1.0 - kept;
        let pairs = FRAMES as f64 * kept - 1.0 + lost.powi(FRAMES as i32);
        let expected = 40_000.0 * pairs / (FRAMES as f64 - 1.0);
        assert!((sums[1] / expected - 1.0).abs() < 0.05, "{kept}: {} {expected}", sums[1]);
    }
}
