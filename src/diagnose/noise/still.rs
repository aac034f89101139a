//! What pixels err by in every view alike: the views' covariance, pixel by pixel.

use rand::Rng;
use rayon::prelude::*;

use super::texture::{SHORT_LINE, pixel_scale, without_lines};
use crate::diagnose::views::field::Field;
use crate::rng::Seed;

/// Covariance of a view's mean residual with the other views' at the same pixels, px^2: without and
/// with what whole lines share.
pub struct Still {
    pub fixed_px2: Option<f64>,
    pub with_lines_px2: Option<f64>,
}

impl Still {
    /// As a share of what a pattern of variance 1 keeps.
    fn over(&self, kept: &Still) -> Still {
        let share = |seen: Option<f64>, kept: Option<f64>| Some(seen? / kept.filter(|k| *k > 0.0)?);
        Still {
            fixed_px2: share(self.fixed_px2, kept.fixed_px2),
            with_lines_px2: share(self.with_lines_px2, kept.with_lines_px2),
        }
    }
}

/// What a pattern of variance 1 keeps in each view where it is measured: every pixel is part of the means that
/// are taken out.
pub struct KeptPattern(Vec<Still>);

impl KeptPattern {
    pub fn of(fields: &[Field]) -> Self {
        let coins = coins(fields.first().map_or(0, |f| f.width * f.height));
        let views = beside_bias(fields, &[]);
        KeptPattern(covariances(&views, |f, _| pixel_scale(f, &tossed(f, &coins), &[])))
    }
}

/// Each view with what is known of it to be no noise, px, by pixel (or nothing).
pub fn beside_bias<'a>(fields: &'a [Field], bias: &'a [Vec<f32>]) -> Vec<(&'a Field, &'a [f32])> {
    let of = |n: usize| bias.get(n).map_or(&[][..], Vec::as_slice);
    fields.iter().enumerate().map(|(n, f)| (f, of(n))).collect()
}

/// Of the views that `kept` was made of, each with what is known of it to be no noise.
pub fn still(views: &[(&Field, &[f32])], kept: &KeptPattern) -> Vec<Still> {
    debug_assert_eq!(views.len(), kept.0.len());
    let seen = covariances(views, |f, b| pixel_scale(f, &f.mean, b));
    seen.iter().zip(&kept.0).map(|(seen, kept)| seen.over(kept)).collect()
}

fn covariances(
    views: &[(&Field, &[f32])],
    image: impl Fn(&Field, &[f32]) -> Vec<f32> + Sync,
) -> Vec<Still> {
    let mut images: Vec<Vec<f32>> = views.par_iter().map(|(f, b)| image(f, b)).collect();
    let with_lines = across_views(&images);
    let of_views = images.par_iter_mut().zip(views);
    of_views.for_each(|(m, (f, _))| *m = without_lines(m, f.width, SHORT_LINE));
    let both = across_views(&images).into_iter().zip(with_lines);
    both.map(|(fixed_px2, with_lines_px2)| Still { fixed_px2, with_lines_px2 }).collect()
}

/// Heads or tails for each pixel of the picture: a pattern whose variance is 1 wherever it is seen.
fn coins(pixels: usize) -> Vec<f32> {
    let mut rng = Seed(0).stream("diagnose/still");
    (0..pixels).map(|_| if rng.random() { 1.0 } else { -1.0 }).collect()
}

/// The coins where the view has a mean.
fn tossed(field: &Field, coins: &[f32]) -> Vec<f32> {
    let pixels = field.pixels.iter().zip(&field.mean);
    pixels.map(|(&i, mean)| if mean.is_finite() { coins[i as usize] } else { f32::NAN }).collect()
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

    use super::*;
    use crate::plane::Plane;
    use crate::simulate::kinect_v1;

    /// A pattern of 0.01 px up or down and no noise, on targets of very different sizes: of its variance
    /// the means that are taken out take 4 to 9 % (numpy), and it has nothing that lines share.
    #[test]
    fn a_pattern_keeps_its_size_on_small_targets() {
        const PATTERN_PX: f64 = 0.01;
        let camera = kinect_v1(1).camera;
        let (width, height) = (camera.width, camera.height);
        let mut rng = Seed(5).stream("still");
        let mut toss = || if rng.random_bool(0.5) { PATTERN_PX } else { -PATTERN_PX };
        let pattern: Vec<f64> = (0..width * height).map(|_| toss()).collect();
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
                field.mean = field.pixels.iter().map(|&i| pattern[i as usize] as f32).collect();
                field
            })
            .into();
        let kept = KeptPattern::of(&fields);
        let seen: Vec<[f64; 2]> = still(&beside_bias(&fields, &[]), &kept)
            .iter()
            .map(|s| [s.fixed_px2, s.with_lines_px2])
            .map(|both| both.map(|px2| px2.expect("large enough") / PATTERN_PX.powi(2)))
            .collect();
        println!("{seen:.4?}");
        // The coins' own products, of pixels that are not the same, make three hundredths on the smallest.
        for [fixed, with_lines] in &seen {
            assert!((fixed - 1.0).abs() < 0.05 && (with_lines - fixed).abs() < 0.05, "{seen:?}");
        }
        let mean = seen.iter().map(|s| s[0]).sum::<f64>() / seen.len() as f64;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
    }
}
