//! Causes that the catalogue lacks: the right answer is "unexplained", with statistic and axis.

use rand::Rng;

use super::causes_bias::{sign, smooth_step, wave};
use super::kernels::roundish;
use super::{Act, Cause, Clock, Label, Phase, Trace, Unit};
use kinoise::rng::Stream;

/// By name.
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
pub fn outside(name: &str, strength: f64, unit: &Unit, rng: &mut Stream) -> Option<Cause> {
    let in_mean = [
        "seam",
        "row-banding",
        "blob",
        "disparity-step",
        "tof-wiggle",
        "interleave",
        "azimuth-saddle",
    ];
    if in_mean.contains(&name) {
        return Some(mean(name, strength, unit, rng));
    }
    Some(match name {
        "first-frame" => first_frame(strength),
        "dead-rows" => dead_rows(strength, unit, rng),
        "noisy-distance" | "noisy-rows" | "tiring" | "dirty-board" | "warm-noise" => {
            spread(name, strength, unit, rng)
        }
        _ => return None,
    })
}

fn mean(name: &str, strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let scale = unit.scale();
    let (width, height) = (unit.sensor.camera.width as f64, unit.sensor.camera.height as f64);
    let size = sign(rng) * strength * scale;
    let share = rng.random_range(0.25..0.75);
    let other = rng.random_range(0.25..0.75);
    let label = |form, axis, a: f64| Label::new(None, form, ["bias", axis], &[("size_px", a)]);
    match name {
        "seam" => {
            let (a, at) = (0.15 * size, share * width);
            let act = Act::mismatch(move |s, _| if s.u > at { a } else { 0.0 });
            Cause::new(label("seam", "column", a).within(at, width), act)
        }
        "row-banding" => {
            let (a, period) = (0.06 * size, (30.0 + 60.0 * share) * scale);
            let act = Act::mismatch(move |s, _| a * wave(s.v / period + other).signum());
            Cause::new(label("row-banding", "row", a).within(0.0, height), act)
        }
        "blob" => {
            let (a, reach) = (0.2 * size, 45.0 * scale);
            let (u, v) = (share * width, other * height);
            let act = Act::mismatch(move |s, _| {
                a * (-((s.u - u).powi(2) + (s.v - v).powi(2)) / (2.0 * reach * reach)).exp()
            });
            let mut label = label("blob", "pixel", a).also(&["column", "row", "radius"]);
            label.parameters.extend([("u".into(), u.into()), ("v".into(), v.into())]);
            Cause::new(label, act)
        }
        "disparity-step" => {
            let (a, at) = (0.12 * size, unit.disparity_px_m() / (1.0 + 2.0 * share));
            let act = Act::mismatch(move |s, _| if s.disparity > at { a } else { 0.0 });
            let label = label("disparity-step", "z", a).also(&["disparity-phase"]);
            Cause::new(label.within(0.0, unit.disparity_px_m() / at), act)
        }
        "tof-wiggle" => {
            let (a, period) = (0.004 * size / scale, 0.25 + 0.4 * share);
            let fb = unit.disparity_px_m();
            let act = Act::mismatch(move |s, _| -fb * a * wave(s.z / period) / (s.z * s.z));
            let form = Label::new(
                None,
                "tof-wiggle",
                ["bias", "z"],
                &[("size_m", a), ("period_m", period)],
            );
            Cause::new(form, act)
        }
        "interleave" => {
            let a = 0.04 * size;
            let act =
                Act::mismatch(move |s, _| if (s.u as usize).is_multiple_of(2) { a } else { -a });
            Cause::new(label("interleave", "column", a).also(&["pixel"]), act)
        }
        _ => {
            let a = 0.25 * size;
            let act = Act::mismatch(move |s, f| {
                let along = s.x * f.stage.azimuth.cos() + s.y * f.stage.azimuth.sin();
                a * f.stage.theta.tan() * (along * 2.0).powi(2)
            });
            Cause::new(label("azimuth-saddle", "azimuth", a).also(&["theta", "radius"]), act)
        }
    }
}

fn spread(name: &str, strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let growth = 0.5 * strength;
    let share = rng.random_range(0.25..0.75);
    let label = |form, axis| Label::new(None, form, ["variance", axis], &[("growth", growth)]);
    let height = unit.sensor.camera.height as f64;
    match name {
        "noisy-distance" => {
            let (at, reach) = (1.2 + 1.4 * share, 0.2);
            let bump = move |z: f64| growth * (-0.5 * ((z - at) / reach).powi(2)).exp();
            let label = label("noisy-distance", "z").within(at - reach, at + reach);
            Cause::new(label, Act::spread(move |s, _| 1.0 + bump(s.z)))
        }
        "noisy-rows" => {
            let label = label("noisy-rows", "row").within(share * height, height);
            let act = Act::spread(move |s, _| {
                1.0 + growth
                    * smooth_step(s.v, (0.5 + 0.5 * share) * height, (1.0 - share) * height)
            });
            Cause::new(label, act)
        }
        "tiring" => {
            let act = Act::spread(move |_, f| 1.0 + growth * f.session_s / 1800.0);
            Cause::new(label("tiring", "session-time"), act)
        }
        "warm-noise" => {
            let act =
                Act::spread(move |_, f| 1.0 + growth * ((f.temperature_c - ROOM_C) / 8.0).max(0.0));
            Cause::new(label("warm-noise", "temperature"), act)
        }
        _ => {
            let centre = [0.5 * (share - 0.5), 0.1];
            let act = Act::spread(move |s, _| {
                let (p, q) = (s.place[0] - centre[0], s.place[1] - centre[1]);
                let bump = growth * (-(p * p + q * q) / 0.045).exp();
                if s.on_board { 1.0 + 1.5 * bump } else { 1.0 }
            });
            Cause::new(label("dirty-board", "target-position"), act)
        }
    }
}

/// The exposure has not settled in a view's first frame.
fn first_frame(strength: f64) -> Cause {
    let growth = 0.25 * strength;
    let label = Label::new(None, "first-frame", ["variance", "frame"], &[("growth", growth)]);
    let louder = move |field: &mut [f32], clock: &Clock| {
        if clock.frame == 0 {
            field.iter_mut().for_each(|x| *x *= 1.0 + growth as f32);
        }
    };
    let act = Act::grain(Phase::Tails, louder);
    Cause::new(label.within(0.0, 0.01), act).tracing(Trace::FirstFrame(growth))
}

/// A band of rows answers less often.
fn dead_rows(strength: f64, unit: &Unit, rng: &mut Stream) -> Cause {
    let height = unit.sensor.camera.height as f64;
    let from = rng.random_range(0.2..0.7) * height;
    let (to, lost) = (from + 0.06 * height, 0.1 * strength);
    let label = Label::new(None, "dead-rows", ["missing", "row"], &[("share", lost)]);
    let ragged: Vec<f64> =
        (0..height as usize).map(|_| 1.0 + 0.2 * f64::from(roundish(rng))).collect();
    let act = Act::loss(move |s, _| {
        if (from..to).contains(&s.v) { (lost * ragged[s.v as usize]).min(1.0) } else { 0.0 }
    });
    Cause::new(label.within(from, to), act)
}
