//! The catalogue's causes of noise: its size, its correlation and its tails; and of pixels
//! without an answer.

use std::f64::consts::{FRAC_PI_2, LN_2, SQRT_2, TAU};

use rand::Rng;
use rand_distr::{ChiSquared, Distribution, Exp1};
use statrs::function::erf::erfc;

use super::geometry::shaded;
use super::kernels::{Window, fresh, lot, roundish, white};
use super::worth::{of_average, of_frozen, of_strays, of_student, of_window};
use super::{Act, Cause, Clock, Draw, Phase, loss, spread};
use kinoise::rng::Stream;

/// Illuminance of an office, lx.
const OFFICE_LUX: f64 = 500.0;
/// Reflectance of white paper.
const WHITE: f64 = 0.8;

/// The cause of this name; `None` when it is none of these.
pub fn cause(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Option<Cause> {
    Some(match name {
        "grazing-dropout" | "range-dropout" | "occlusion-shadow" => missing(name, of, rng),
        "heavy-tails" => heavy_tails(name, of.strength, rng),
        "spatial-correlation" => spatial_correlation(of.strength, rng),
        "temporal-correlation" => temporal_correlation(name, of.strength),
        "frozen-noise" => frozen_noise(name, of.strength),
        "row-noise" | "frame-jitter" => shaking(name, of, rng),
        _ => return noisier(name, of, rng),
    })
}

/// Causes that make some pixels noisier than sigma(z, theta) says.
fn noisier(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Option<Cause> {
    let Draw { strength, unit, .. } = *of;
    let growth = 0.5 * strength;
    Some(match name {
        // Grows faster at long range.
        "range-exponent" => {
            let form = lot(&["softplus", "z^4 in quadrature"], rng);
            spread(name, form, "z", &[("growth", growth)], move |s, _| match form {
                "softplus" => 1.0 + 0.2 * strength * ((s.z - 1.8) / 0.5).exp().ln_1p(),
                _ => (1.0 + 0.5 * strength * (s.z / 2.5).powi(4)).sqrt(),
            })
        }
        // The ray jitters over the slope, pixel by pixel.
        "slope-noise" => {
            let lateral = 0.8 * strength * unit.scale();
            let (at, parameters) = (["variance", "theta"], [("sigma_lateral_px", lateral)]);
            Cause::new(name, "trembling rays", at, &parameters, Act::Wander(lateral))
        }
        // The disparity gradient stretches the window: noisier along the baseline, calmer across it.
        "tilt-axis-anisotropy" => {
            let parameters = [("ratio", 1.0 + growth)];
            let steep2 = 3.0; // tan^2 of 60 degrees
            spread(name, "stretched window, tan^2", "azimuth", &parameters, move |s, f| {
                if !s.on_board {
                    return 1.0;
                }
                let (sin, cos) = f.stage.azimuth.sin_cos();
                let stretch = growth / steep2 * s.theta.tan().powi(2);
                ((1.0 + stretch * cos * cos) / (1.0 + stretch * sin * sin)).sqrt()
            })
        }
        // The cos^4 law, or a lens that shades only its rim.
        "vignetting" => {
            let form = lot(&["cos^-4", "r^4 rim"], rng);
            let half = 400.0 * unit.scale() / unit.sensor.camera.fx;
            let law = |tan2: f64| (1.0 + tan2).powi(2) - 1.0;
            spread(name, form, "radius", &[("growth", growth)], move |s, _| match form {
                "cos^-4" => 1.0 + growth * law(s.x * s.x + s.y * s.y) / law(half * half),
                _ => 1.0 + growth * (0.3 * s.radius.powi(2) + 0.7 * s.radius.powi(4)),
            })
        }
        // Shot noise over a floor: only part of the variance goes as one over the print's albedo.
        "intensity-dependent-noise" => {
            let form = "shot noise over a floor";
            spread(name, form, "intensity", &[("share", growth)], move |s, _| {
                (1.0 + growth * (WHITE / s.albedo - 1.0)).sqrt()
            })
        }
        // Background light relative to the pattern's, which falls with distance and slant.
        "ambient-light" => {
            let ratio = 0.05 * strength;
            let power = rng.random_range(0.4..0.6);
            let form = "power law of background over signal";
            spread(name, form, "intensity", &[("ratio", ratio), ("power", power)], move |s, f| {
                let signal = s.facing / s.point.norm_squared();
                (1.0 + ratio * f.lux / OFFICE_LUX / signal).powf(power)
            })
        }
        _ => return None,
    })
}

/// Student's t of unit variance, or a few Laplace errors among Gaussian ones.
fn heavy_tails(name: &str, strength: f64, rng: &mut Stream) -> Cause {
    let tails = ["distribution", "residual"];
    if lot(&[true, false], rng) {
        let nu = 3.0 + 2.0 / strength;
        let chi = ChiSquared::new(nu).expect("more than three degrees of freedom");
        let widen = move |field: &mut [f32], clock: &Clock| {
            let mut rng = clock.stream("student");
            let scale = (nu - 2.0).sqrt();
            field.iter_mut().for_each(|x| *x *= (scale / chi.sample(&mut rng).sqrt()) as f32);
        };
        let act = Act::Grain(Phase::Tails, Box::new(widen));
        return Cause::new(name, "student", tails, &[("nu", nu)], act)
            .worth(move |ground| ground.views(|look| look.frames()) * of_student(nu));
    }
    let (fraction, scale): (f64, f32) = (0.015 * strength, rng.random_range(3.0..5.0));
    let stray = move |field: &mut [f32], clock: &Clock| {
        let mut rng = clock.stream("laplace");
        for x in field {
            if rng.random::<f32>() < fraction as f32 {
                let away: f32 = Exp1.sample(&mut rng);
                *x = scale * away * x.signum();
            }
        }
    };
    let scale = f64::from(scale);
    let parameters = [("fraction", fraction), ("scale", scale * 2f64.sqrt())];
    let act = Act::Grain(Phase::Tails, Box::new(stray));
    Cause::new(name, "laplace mixture", tails, &parameters, act)
        .worth(move |ground| ground.views(|look| look.frames()) * of_strays(fraction, scale))
}

/// Neighbours share a window that is not flat. Below strength 1 only part of the noise goes through it; the
/// read-out adds the rest.
fn spatial_correlation(strength: f64, rng: &mut Stream) -> Cause {
    let side = 7.0 * strength.max(1.0);
    let bell = lot(&[true, false], rng);
    let window = if bell { Window::bell(side) } else { Window::tent(side) };
    windowed(if bell { "gaussian window" } else { "triangular window" }, window, strength)
}

/// `share` of the variance goes through `window`, the rest is independent in each pixel.
pub fn windowed(form: &str, window: Window, share: f64) -> Cause {
    let share = share.min(1.0);
    let mut parameters = vec![("length_px", window.side())];
    parameters.extend((share < 1.0).then_some(("share", share)));
    let (through, own) = (share.sqrt() as f32, (1.0 - share).sqrt() as f32);
    let seen = window.clone();
    let blur = move |field: &mut [f32], clock: &Clock| {
        if share < 1.0 {
            let mut matched = white(field.len(), clock.stream("matched"));
            seen.blur(&mut matched, clock.width);
            field.iter_mut().zip(matched).for_each(|(x, m)| *x = own * *x + through * m);
        } else {
            seen.blur(field, clock.width);
        }
    };
    let act = Act::Grain(Phase::InSpace, Box::new(blur));
    let at = ["correlation", "pixel-lag"];
    let cause = Cause::new("spatial-correlation", form, at, &parameters, act);
    let told = window.clone();
    Cause { window: Some((window, share)), ..cause }
        .worth(move |ground| ground.views(|look| look.frames() * of_window(&told, share)))
}

/// A moving average over two frames, with the earlier one weaker; beyond strength 1 over three.
fn temporal_correlation(name: &str, strength: f64) -> Cause {
    let weights = if strength <= 1.0 {
        vec![1.0, strength]
    } else {
        vec![1.0, 1.0, (strength - 1.0).min(1.0)]
    };
    let norm = weights.iter().map(|w| w * w).sum::<f64>();
    let rho = weights.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / norm;
    let parameters = [("rho", rho), ("frames", weights.len() as f64)];
    let weights: Vec<f64> = weights.iter().map(|w| w / norm.sqrt()).collect();
    let known = weights.clone();
    let average = move |field: &mut [f32], clock: &Clock| {
        field.iter_mut().for_each(|x| *x *= weights[0] as f32);
        for (ago, weight) in weights.iter().enumerate().skip(1) {
            let earlier = Clock { frame: clock.frame - ago as i64, ..*clock };
            let earlier = fresh(&earlier, field.len());
            field.iter_mut().zip(earlier).for_each(|(x, e)| *x += *weight as f32 * e);
        }
    };
    let act = Act::Grain(Phase::InTime, Box::new(average));
    Cause::new(name, "moving average", ["correlation", "frame"], &parameters, act).worth(
        move |ground| {
            let gain = ground.views(|look| of_average(&known, look.plan().stamps.len()));
            gain / ground.repeats.squares
        },
    )
}

/// Noise that is fixed within a view: a sum of uniforms.
fn frozen_noise(name: &str, strength: f64) -> Cause {
    let fraction = strength / (strength + 0.5);
    let (still, alive) = (fraction.sqrt() as f32, (1.0 - fraction).sqrt() as f32);
    let mix = move |field: &mut [f32], clock: &Clock| {
        let mut rng = Clock { frame: 0, ..*clock }.stream("grain");
        field.iter_mut().for_each(|x| *x = alive * *x + still * roundish(&mut rng));
    };
    let (at, parameters) = (["correlation", "frame"], [("fraction", fraction)]);
    let act = Act::Grain(Phase::AtRest, Box::new(mix));
    Cause::new(name, "sum of four uniforms", at, &parameters, act).worth(move |ground| {
        let gain = ground.views(|look| of_frozen(fraction, look.plan().stamps.len()));
        gain / ground.repeats.squares
    })
}

/// A uniform shift of each row; or a swinging mount: a sine with a random phase in every view.
fn shaking(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Cause {
    let sigma = 0.03 * of.strength * of.unit.scale();
    if name == "row-noise" {
        let half = (sigma * 3f64.sqrt()) as f32;
        let shift = move |clock: &Clock, rows: &mut [f32]| {
            let mut rng = clock.stream("rows");
            rows.iter_mut().for_each(|row| *row += rng.random_range(-half..half));
        };
        let (at, act) = (["correlation", "row"], Act::Shake(Box::new(shift)));
        return Cause::new(name, "uniform", at, &[("sigma_px", sigma)], act)
            .worth(move |ground| ground.of_rows(sigma));
    }
    let hertz = rng.random_range(7.0..13.0);
    let swing = move |clock: &Clock, rows: &mut [f32]| {
        let phase: f64 = clock.seed.stream(&format!("rays/phase/{}", clock.view)).random();
        let shift = sigma * 2f64.sqrt() * (TAU * (hertz * clock.view_s + phase)).sin();
        rows.iter_mut().for_each(|row| *row += shift as f32);
    };
    let (at, act) = (["correlation", "frame"], Act::Shake(Box::new(swing)));
    Cause::new(name, "vibration", at, &[("sigma_px", sigma), ("hertz", hertz)], act)
        .worth(move |ground| ground.of_frames(sigma))
}

/// Pixels without an answer: beyond an angle, beyond or short of a distance, or where the board blocks the
/// projector's light.
fn missing(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Cause {
    let forms = ["normal cdf", "gompertz"];
    match name {
        "grazing-dropout" => {
            let (middle, width) = (66.0 - 6.0 * of.strength.log2(), rng.random_range(2.0..4.0));
            let form = lot(&forms, rng);
            let parameters = [("theta50_deg", middle), ("width_deg", width)];
            loss(name, form, "theta", &parameters, move |s, _| {
                rise(form, (s.theta.to_degrees() - middle) / width)
            })
            .within((middle - width).min(89.0).to_radians(), FRAC_PI_2)
        }
        "range-dropout" => {
            let (near, log) = (rng.random_range(0..4) == 0, of.strength.log2());
            let middle = if near { 0.95 + 0.1 * log } else { 3.0 - 0.4 * log };
            let width = rng.random_range(0.08..0.2) * if near { -0.5 } else { 1.0 };
            let form = lot(&forms, rng);
            let [low, high] = if near { [0.0, middle - width] } else { [middle - width, 10.0] };
            loss(name, form, "z", &[("z50_m", middle), ("width_m", width)], move |s, _| {
                rise(form, (s.z - middle) / width)
            })
            .within(low, high)
        }
        _ => {
            let (share, baseline_m) = (of.shadow, of.unit.baseline_m);
            loss(name, "shadow rays", "edge-distance", &[("share", share)], move |s, f| {
                let dark = !s.on_board && shaded(&f.stage, baseline_m, &s.point);
                if dark { share } else { 0.0 }
            })
        }
    }
}

/// Rises from 0 to 1 and is 0.5 at 0.
fn rise(form: &str, t: f64) -> f64 {
    match form {
        "normal cdf" => 0.5 * erfc(-t / SQRT_2),
        _ => (-LN_2 * (-t).exp()).exp(),
    }
}
