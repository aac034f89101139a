//! What pixels err by in every view alike: the views' covariance, pixel by pixel.

use rayon::prelude::*;

use super::texture::{SHORT_LINE, pixel_scale, without_lines};
use crate::camera::Camera;
use crate::diagnose::views::field::Field;

/// Covariance of a view's mean residual with the other views' at the same pixels, px^2: without and
/// with what whole lines share.
pub struct Still {
    pub fixed_px2: Option<f64>,
    pub with_lines_px2: Option<f64>,
}

pub fn still(views: &[(&Field, &[f32])], camera: &Camera) -> Vec<Still> {
    let seen = covariances(views, camera, |f, b| pixel_scale(f, &f.mean, b));
    // Every pixel is part of the means that are taken out: what is left of a pattern of variance 1.
    let kept = covariances(views, camera, |f, _| pixel_scale(f, &coins(f), &[]));
    let over = |seen: Option<f64>, kept: Option<f64>| Some(seen? / kept.filter(|k| *k > 0.0)?);
    let pairs = seen.into_iter().zip(kept);
    let of = |(seen, kept): ([Option<f64>; 2], [Option<f64>; 2])| Still {
        fixed_px2: over(seen[0], kept[0]),
        with_lines_px2: over(seen[1], kept[1]),
    };
    pairs.map(of).collect()
}

/// View by view, without and with what whole lines share.
fn covariances(
    views: &[(&Field, &[f32])],
    camera: &Camera,
    image: impl Fn(&Field, &[f32]) -> Vec<f32> + Sync,
) -> Vec<[Option<f64>; 2]> {
    let mut images: Vec<Vec<f32>> = views.par_iter().map(|(f, b)| image(f, b)).collect();
    let with_lines = across_views(&images);
    images.par_iter_mut().for_each(|m| *m = without_lines(m, camera.width, SHORT_LINE));
    across_views(&images).into_iter().zip(with_lines).map(|(a, b)| [a, b]).collect()
}

/// Heads or tails for each pixel of the picture, the same in every view that sees it.
fn coins(field: &Field) -> Vec<f32> {
    let toss = |(&pixel, mean): (&u32, &f32)| {
        // The finaliser of MurmurHash3: every bit of the number reaches every bit of the result.
        let mut h = pixel;
        h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
        if mean.is_finite() { 1.0 - (h >> 15 & 2) as f32 } else { f32::NAN }
    };
    field.pixels.iter().zip(&field.mean).map(toss).collect()
}

/// Mean product of each view's mean residual with the mean of the others', px^2.
fn across_views(means: &[Vec<f32>]) -> Vec<Option<f64>> {
    let n = means.iter().map(Vec::len).max().unwrap_or(0);
    let mut sum = vec![0f32; n];
    let mut count = vec![0u16; n];
    for image in means {
        for ((s, c), &r) in sum.iter_mut().zip(&mut count).zip(image) {
            if r.is_finite() {
                *s += r;
                *c += 1;
            }
        }
    }
    let of = |image: &Vec<f32>| {
        let (mut products, mut n) = (0.0, 0.0);
        for ((&s, &c), &r) in sum.iter().zip(&count).zip(image) {
            if r.is_finite() && c > 1 {
                // Pixels that many views saw say more.
                let others = f64::from(c - 1);
                products += f64::from(r) * f64::from(s - r);
                n += others;
            }
        }
        (n > 1000.0).then(|| products / n)
    };
    means.par_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::plane::Plane;
    use crate::rng::Seed;
    use crate::simulate::kinect_v1;

    /// A pattern of 0.01 px under three times as much noise, on targets of very different sizes: its
    /// variance within four of its standard errors, and nothing that lines share.
    #[test]
    fn a_pattern_keeps_its_size_on_small_targets() {
        const PATTERN_PX: f64 = 0.01;
        let camera = kinect_v1(1).camera;
        let (width, height) = (camera.width, camera.height);
        let mut rng = Seed(5).stream("still");
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let pattern: Vec<f64> = (0..width * height).map(|_| PATTERN_PX * normal()).collect();
        let fields: Vec<Field> = [36, 48, 60, 100, 160, 220]
            .map(|side| {
                let at = |i: &usize| {
                    let (u, v) =
                        ((i % width).abs_diff(width / 2), (i / width).abs_diff(height / 2));
                    2 * u.max(v) < side
                };
                let pixels: Vec<u32> = (0..width * height).filter(at).map(|i| i as u32).collect();
                let plane = Plane { q: Vector3::new(0.0, 0.0, 1.0) };
                let mut field = Field::unseen(plane, 40.0, [width, height], pixels);
                let seen = |&i: &u32| (pattern[i as usize] + 3.0 * PATTERN_PX * normal()) as f32;
                field.mean = field.pixels.iter().map(seen).collect();
                field
            })
            .into();
        let views: Vec<(&Field, &[f32])> = fields.iter().map(|f| (f, &[][..])).collect();
        for (view, still) in fields.iter().zip(still(&views, &camera)) {
            let [fixed, with_lines] = [still.fixed_px2, still.with_lines_px2]
                .map(|px2| px2.expect("large enough") / PATTERN_PX.powi(2));
            // Of the product of one view's noise with that of one other.
            let error = 10.0 / (view.pixels.len() as f64).sqrt();
            assert!((fixed - 1.0).abs() < 4.0 * error, "{} px: {fixed}", view.pixels.len());
            assert!((with_lines - fixed).abs() < error, "{with_lines} {fixed}");
        }
    }
}
