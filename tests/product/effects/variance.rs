//! Size of the noise, and where it is large.
//!
//! A standard deviation over n pixels has a relative standard error of 1 / sqrt(2 n): 0.26 % over an image of
//! 76,800. Tolerances are five standard errors: false alarm probability 6e-7 per comparison.

use kinoise::scene::{PATCH_SIDE_M, Print};

use super::laboratory::{Laboratory, close, instant, line, sd};

const SIGMA_M: f64 = 0.002;
const WHOLE_PICTURE: f64 = 0.013;

/// Index and error in units of the model's sigma, of each valid pixel.
fn standardised(lab: &Laboratory) -> Vec<(usize, f64)> {
    let errors = lab.depth_errors(&lab.frame());
    let each = errors.into_iter().enumerate().filter(|(_, e)| e.is_finite());
    each.map(|(i, e)| (i, e / SIGMA_M)).collect()
}

/// Standard deviation of the standardised errors, divided by `expected` at each pixel.
fn left_over(lab: &Laboratory, expected: impl Fn(usize) -> f64) -> f64 {
    let errors: Vec<f64> = standardised(lab).iter().map(|&(i, e)| e / expected(i)).collect();
    sd(&errors)
}

fn noisy(z: f64, theta: f64, azimuth: f64, effect: &str) -> Laboratory {
    Laboratory::wall(z, theta, azimuth).noise(SIGMA_M).with(effect)
}

#[test]
fn another_power_of_z() {
    for z in [1.0, 2.0, 4.0] {
        let got = left_over(&noisy(z, 0.0, 0.0, "range-exponent:excess=0.5"), |_| 1.0);
        close(got / (z / 2.0).sqrt(), 1.0, WHOLE_PICTURE, "sigma over (z / 2 m)^0.5");
    }
}

/// Variances add: the model's and (0.8 px dz/du)^2. With fx = 290 px, dz/du is z tan(theta) / 290 px on the
/// optical axis, and grows with z^2 over the plane.
#[test]
fn a_slope_turns_lateral_noise_into_depth_noise() {
    for theta in [30.0f64, 60.0] {
        let axis = 1.2;
        let lab = noisy(axis, theta, 90.0, "slope-noise:sigma_lateral_px=0.8");
        let truth = lab.truth();
        let slope = 0.8 / 290.0 * theta.to_radians().tan() / axis;
        let got = left_over(&lab, |i| 1f64.hypot(slope * truth[i].powi(2) / SIGMA_M));
        // At 60 degrees the far half is out of range: fewer pixels.
        close(got, 1.0, 0.02, "sigma");
    }
}

#[test]
fn a_frontal_plane_has_neither_slope_nor_direction() {
    let bare = Laboratory::wall(1.5, 0.0, 0.0).noise(SIGMA_M);
    for effect in ["slope-noise", "tilt-axis-anisotropy"] {
        assert_eq!(bare.frame(), bare.clone().with(effect).frame(), "{effect}");
    }
}

/// At 60 degrees along and across the baseline, in both directions.
#[test]
fn tilt_along_the_baseline_is_noisier() {
    let at =
        |azimuth| left_over(&noisy(1.0, 60.0, azimuth, "tilt-axis-anisotropy:ratio=1.5"), |_| 1.0);
    for (along, across) in [(0.0, 90.0), (180.0, -90.0)] {
        close(at(along) / at(across), 1.5, 0.03, "ratio");
        close(at(along) * at(across), 1.0, 0.03, "the mean over directions stays");
    }
    close(at(45.0), 1.0, 0.02, "between the two");
}

/// Tests four rings of the image.
#[test]
fn corners_are_noisier() {
    let lab = noisy(1.5, 0.0, 0.0, "vignetting:growth=0.5");
    let corner = 159.5f64.hypot(119.5);
    let radius = |i| {
        let (du, dv) = lab.off_centre(i);
        du.hypot(dv) / corner
    };
    let errors = standardised(&lab);
    for ring in 0..4 {
        let inside = |r: f64| (r * 4.0).floor() == f64::from(ring);
        let ring: Vec<f64> = errors
            .iter()
            .map(|&(i, e)| (radius(i), e))
            .filter(|(r, _)| inside(*r))
            .map(|(r, e)| e / (1.0 + 0.5 * r * r))
            .collect();
        close(sd(&ring), 1.0, 5.0 / (2.0 * ring.len() as f64).sqrt(), "a ring's sigma");
    }
}

/// On a print of eight greys, sigma is a power of the reflectance: a line in the logarithms. The infrared
/// image shows the greys too.
#[test]
fn dark_patches_are_noisier() {
    let mut lab = noisy(1.5, 0.0, 0.0, "intensity-dependent-noise:exponent=0.5");
    lab.bench.print = Print::Patches(PATCH_SIDE_M);
    let (errors, seen) = (standardised(&lab), lab.seen());
    let light = &lab.shots(&[instant(0, 0)])[0].light;
    let (mut grey, mut sigma) = (Vec::new(), Vec::new());
    for eighth in 1..=8u8 {
        let albedo = f32::from(eighth) / 8.0;
        let patch: Vec<usize> = (0..light.len()).filter(|&i| seen.albedo[i] == albedo).collect();
        let of_patch: Vec<f64> =
            errors.iter().filter(|(i, _)| seen.albedo[*i] == albedo).map(|(_, e)| *e).collect();
        assert!(of_patch.len() > 1000, "{eighth}");
        grey.push(f64::from(albedo).ln());
        sigma.push(sd(&of_patch).ln());
        let brightest = patch.iter().map(|&i| light[i]).fold(0.0, f32::max);
        assert!(brightest <= albedo / (1.5 * 1.5) * 1.001, "infrared light of grey {eighth}");
    }
    let (slope, _) = line(&grey, &sigma);
    // Each patch's logarithm is known to 1 %, the slope over ln 8 to 0.7 %.
    close(slope, -0.5, 0.035, "exponent");
}

/// Shot noise of pattern and room light: sigma^2 grows by ambient over pattern light, and the pattern falls
/// with the square of the range and the cosine.
#[test]
fn room_light_makes_noise_as_it_outshines_the_pattern() {
    for (lux, z) in [(0.0, 2.0), (500.0, 2.0), (500.0, 4.0), (2000.0, 2.0)] {
        let mut lab = noisy(z, 0.0, 0.0, "ambient-light:ratio=0.1");
        lab.lux = lux;
        let over = |i| {
            let (du, dv) = lab.off_centre(i);
            let range = z * (1.0 + (du * du + dv * dv) / (290.0 * 290.0)).sqrt();
            0.1 * lux / 500.0 * range.powi(3) / z
        };
        close(left_over(&lab, |i| (1.0 + over(i)).sqrt()), 1.0, WHOLE_PICTURE, "sigma");
        // Pattern light 0.8 / z^2 from a white surface, plus the room's light.
        let middle = 120 * 320 + 160;
        let light = f64::from(lab.shots(&[instant(0, 0)])[0].light[middle]);
        close(light * z * z / 0.8, 1.0 + over(middle), 0.001, "infrared light");
    }
}
