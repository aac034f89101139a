//! Causes that the catalogue lacks: the right answer is "unexplained", with statistic and axis.

use std::f64::consts::{PI, TAU};

use rand::Rng;

use super::kernels::{roundish, sign};
use super::worth::of_variance;
use super::{Act, Cause, Clock, Draw, Phase, bias, loss, spread};
use kinoise::rng::Stream;

pub const OUTSIDE: [&str; 14] = [
    "seam",
    "row-banding",
    "blob",
    "noisy-distance",
    "disparity-step",
    "noisy-rows",
    "tof-wiggle",
    "tiring",
    "interleave",
    "dirty-board",
    "azimuth-saddle",
    "dead-rows",
    "warm-noise",
    "first-frame",
];

const ROOM_C: f64 = 22.0;

/// The cause of this name; `None` when there is none.
pub fn cause(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Option<Cause> {
    Some(match name {
        "seam" | "row-banding" | "blob" | "disparity-step" | "tof-wiggle" | "interleave"
        | "azimuth-saddle" => in_mean(name, of, rng),
        "noisy-distance" | "noisy-rows" | "tiring" | "dirty-board" | "warm-noise" => {
            noisier(name, of, rng)
        }
        "first-frame" => first_frame(name, of.strength),
        "dead-rows" => dead_rows(name, of, rng),
        _ => return None,
    })
}

/// Sine with one period from 0 to 1.
fn wave(phase: f64) -> f64 {
    (TAU * phase).sin()
}

fn in_mean(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Cause {
    let unit = of.unit;
    let (scale, fb) = (unit.scale(), unit.disparity_px_m());
    let (width, height) = (unit.sensor.camera.width as f64, unit.sensor.camera.height as f64);
    let size = sign(rng) * of.strength * scale;
    let share = rng.random_range(0.25..0.75);
    let other = rng.random_range(0.25..0.75);
    match name {
        "seam" => {
            let (a, at) = (0.15 * size, share * width);
            let f = move |s: &super::Site, _: &super::Plan| if s.u > at { a } else { 0.0 };
            bias(name, name, "column", &[("size_px", a)], f).within(at, width)
        }
        "row-banding" => {
            let (a, period) = (0.06 * size, (30.0 + 60.0 * share) * scale);
            bias(name, name, "row", &[("size_px", a)], move |s, _| {
                a * wave(s.v / period + other).signum()
            })
            .within(0.0, height)
        }
        "blob" => {
            let (a, reach) = (0.2 * size, 45.0 * scale);
            let (u, v) = (share * width, other * height);
            bias(name, name, "pixel", &[("size_px", a), ("u", u), ("v", v)], move |s, _| {
                a * (-((s.u - u).powi(2) + (s.v - v).powi(2)) / (2.0 * reach * reach)).exp()
            })
            .also(&["column", "row", "radius"])
        }
        "disparity-step" => {
            let (a, at) = (0.12 * size, fb / (1.0 + 2.0 * share));
            let step = move |s: &super::Site, _: &super::Plan| {
                if s.disparity > at { a } else { 0.0 }
            };
            bias(name, name, "z", &[("size_px", a)], step)
                .also(&["disparity-phase"])
                .within(0.0, fb / at)
        }
        "tof-wiggle" => {
            let (a, period) = (0.004 * size / scale, 0.25 + 0.4 * share);
            bias(name, name, "z", &[("size_m", a), ("period_m", period)], move |s, _| {
                -fb * a * wave(s.z / period) / (s.z * s.z)
            })
        }
        "interleave" => {
            let a = 0.04 * size;
            bias(name, name, "column", &[("size_px", a)], move |s, _| {
                if (s.u as usize).is_multiple_of(2) { a } else { -a }
            })
            .also(&["pixel"])
        }
        _ => {
            let a = 0.25 * size;
            bias(name, name, "azimuth", &[("size_px", a)], move |s, f| {
                let along = s.x * f.stage.azimuth.cos() + s.y * f.stage.azimuth.sin();
                a * f.stage.theta.tan() * (along * 2.0).powi(2)
            })
            .also(&["theta", "radius"])
        }
    }
}

fn noisier(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Cause {
    let growth = 0.5 * of.strength;
    let parameters = [("growth", growth)];
    let share = rng.random_range(0.25..0.75);
    let height = of.unit.sensor.camera.height as f64;
    match name {
        "noisy-distance" => {
            let (at, reach) = (1.2 + 1.4 * share, 0.2);
            spread(name, name, "z", &parameters, move |s, _| {
                1.0 + growth * (-0.5 * ((s.z - at) / reach).powi(2)).exp()
            })
            .within(at - reach, at + reach)
        }
        "noisy-rows" => spread(name, name, "row", &parameters, move |s, _| {
            let middle = (0.5 + 0.5 * share) * height;
            let t = ((s.v - middle) / ((1.0 - share) * height) + 0.5).clamp(0.0, 1.0);
            1.0 + growth * (0.5 * (1.0 - (PI * t).cos()))
        })
        .within(share * height, height),
        "tiring" => spread(name, name, "session-time", &parameters, move |_, f| {
            1.0 + growth * f.session_s / 1800.0
        }),
        "warm-noise" => spread(name, name, "temperature", &parameters, move |_, f| {
            1.0 + growth * ((f.temperature_c - ROOM_C) / 8.0).max(0.0)
        }),
        _ => spread(name, name, "target-position", &parameters, move |s, _| {
            let (p, q) = (s.place[0] - 0.5 * (share - 0.5), s.place[1] - 0.1);
            let bump = growth * (-(p * p + q * q) / 0.045).exp();
            if s.on_board { 1.0 + 1.5 * bump } else { 1.0 }
        }),
    }
}

/// The exposure has not settled in a view's first frame.
fn first_frame(name: &str, strength: f64) -> Cause {
    let growth = 0.25 * strength;
    let louder = move |field: &mut [f32], clock: &Clock| {
        if clock.frame == 0 {
            field.iter_mut().for_each(|x| *x *= 1.0 + growth as f32);
        }
    };
    let act = Act::Grain(Phase::Tails, Box::new(louder));
    Cause::new(name, name, ["variance", "frame"], &[("growth", growth)], act)
        .within(0.0, 0.01)
        .worth(move |g| g.views(|_| of_variance((1.0 + growth).powi(2))) / g.repeats.squares)
}

/// A band of rows answers less often.
fn dead_rows(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Cause {
    let height = of.unit.sensor.camera.height as f64;
    let from = rng.random_range(0.2..0.7) * height;
    let (to, lost) = (from + 0.06 * height, 0.1 * of.strength);
    let ragged: Vec<f64> =
        (0..height as usize).map(|_| 1.0 + 0.2 * f64::from(roundish(rng))).collect();
    loss(name, name, "row", &[("share", lost)], move |s, _| {
        if (from..to).contains(&s.v) { (lost * ragged[s.v as usize]).min(1.0) } else { 0.0 }
    })
    .within(from, to)
}
