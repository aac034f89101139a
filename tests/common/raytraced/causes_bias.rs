//! The catalogue's causes of bias: in the match, in the target and in the driver.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use rand::Rng;
use statrs::function::erf::erfc;

use super::kernels::{lot, roundish, sign};
use super::{Act, Cause, Draw, Worth, bias};
use kinoise::rng::Stream;

/// The cause of this name; `None` when it is none of these.
pub fn cause(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Option<Cause> {
    let Draw { strength: s, unit, .. } = *of;
    let px = unit.scale();
    Some(match name {
        // Matches come in steps, counted from a reference that is not a whole number of them.
        "disparity-quantisation" => {
            let step = 0.125 * s * px;
            let act = Act::Lattice { step, phase: rng.random_range(0.0..1.0) };
            let form = "steps from a reference disparity";
            let at = ["distribution", "disparity-phase"];
            let cause = Cause::new(name, form, at, &[("step_px", step)], act);
            Cause { worth: Worth::Never, ..cause }
        }
        // Cut off, not rounded.
        "depth-rounding" => {
            let step = 0.002 * s;
            let at = ["distribution", "z"];
            let cause = Cause::new(name, "floor", at, &[("step_m", step)], Act::Floor(step));
            Cause { worth: Worth::Never, ..cause }
        }
        // Pulls matches towards whole pixels; half-way between them the sawtooth jumps and the
        // others are zero.
        "pixel-locking" => {
            let a = 0.05 * s * px;
            let form = lot(&["sawtooth", "triangle", "cubic"], rng);
            bias(name, form, "disparity-phase", &[("amplitude_px", a)], move |s, _| {
                // From -1/2 to 1/2, 0 at a whole pixel.
                let t = s.disparity - s.disparity.round();
                -a * match form {
                    "sawtooth" => 2.0 * t,
                    "triangle" => (1.0 - (4.0 * t.abs() - 1.0).abs()) * t.signum(),
                    // t (1/4 - t^2) is greatest, 1/(12 sqrt 3), at 1/sqrt 12.
                    _ => 12.0 * 3f64.sqrt() * t * (0.25 - t * t),
                }
            })
        }
        // The firmware removes a ramp over the columns in whole steps of the read-out.
        "column-banding" => {
            let step = 0.125 * s * px;
            let period = px * rng.random_range(40.0..200.0);
            let kappa = step / period;
            let start = rng.random_range(0.0..unit.sensor.camera.width as f64);
            let parameters = [("amplitude_px", step / 2.0), ("period_px", period)];
            bias(name, "steps of a rounded ramp", "column", &parameters, move |s, _| {
                let ramp = kappa * (s.u - start);
                (ramp / step).round() * step - ramp
            })
        }
        // A bowl in disparity about the principal point, 0 in the centre, `k` at the corner.
        "radial-disparity-bias" => {
            let k = sign(rng) * 0.25 * s * px;
            let form = lot(&["1 - cos", "r^2 and r^4", "gaussian well"], rng);
            bias(name, form, "radius", &[("k_px", k)], move |s, _| {
                let r = s.radius;
                k * match form {
                    "1 - cos" => 1.0 - (FRAC_PI_2 * r).cos(),
                    "r^2 and r^4" => 0.4 * r.powi(2) + 0.6 * r.powi(4),
                    _ => (1.0 - (-r * r).exp()) / (1.0 - (-1f64).exp()),
                }
            })
        }
        // The division model: ray = bent / (1 + lambda r^2).
        "lens-distortion" => {
            let lambda = sign(rng) * 0.03 * s;
            let bend = move |x: f64, y: f64| {
                let by = 1.0 + lambda * (x * x + y * y);
                (x / by, y / by)
            };
            let at = ["bias", "radius"];
            Cause::new(name, "division model", at, &[("k1", lambda)], Act::Ray(Box::new(bend)))
        }
        // Range along the ray instead of depth, or partly converted, as with a wrong focal length.
        "range-not-depth" => {
            let share = s.powf(1.5).min(1.0);
            let form = if share < 1.0 { "half undone" } else { "ray length" };
            let gain = move |s: &super::Site, _: &super::Plan| {
                let r2 = s.x * s.x + s.y * s.y;
                ((1.0 + r2) / (1.0 + (1.0 - share) * r2)).sqrt()
            };
            let act = Act::Gain(Box::new(gain));
            Cause::new(name, form, ["bias", "radius"], &[("share", share)], act)
        }
        // Triangulated with a baseline that is not the unit's.
        "depth-scale" => {
            let believed_m = unit.baseline_m * (1.0 + sign(rng) * 0.02 * s);
            let scale = believed_m / unit.baseline_m;
            let act = Act::Gain(Box::new(move |_, _| scale));
            Cause::new(name, "wrong baseline", ["bias", "z"], &[("scale", scale)], act)
        }
        // The reference plane is not where the driver believes it is.
        "disparity-offset" => {
            let reference_m = rng.random_range(1.2..2.5);
            let offset = sign(rng) * 0.1 * s * px;
            // Displacement of the reference plane that shifts the pattern by `offset`.
            let off_m = offset * reference_m * reference_m / unit.disparity_px_m();
            let wrong = unit.disparity_px_m() * (1.0 / reference_m - 1.0 / (reference_m + off_m));
            let form = "reference plane misplaced";
            bias(name, form, "z", &[("offset_px", wrong)], move |_, _| wrong)
        }
        // Warm-up that does not settle exponentially.
        "thermal-drift" => {
            let relative = sign(rng) * 0.004 * s;
            let tau_s = rng.random_range(500.0..1200.0);
            let form = lot(&["tanh", "t / (t + tau)"], rng);
            let gain = move |_: &super::Site, f: &super::Plan| {
                let t = f.session_s / tau_s;
                let warmth = if form == "tanh" { t.tanh() } else { t / (0.6 + t) };
                1.0 + relative * warmth
            };
            let parameters = [("relative", relative), ("time_constant_s", tau_s)];
            let act = Act::Gain(Box::new(gain));
            Cause::new(name, form, ["bias", "session-time"], &parameters, act)
        }
        "target-bow" => target_bow(name, of, rng),
        // The board moves along its normal and accelerates or slows down.
        "target-motion" => {
            let velocity = sign(rng) * 0.005 * s;
            // Over the few tenths of a second of a view.
            let acceleration = velocity * rng.random_range(-0.5..0.5);
            let gone = move |t: f64| t * (velocity + 0.5 * acceleration * t);
            let act = Act::Move(Box::new(gone));
            let parameters = [("velocity_mps", velocity)];
            Cause::new(name, "accelerated", ["bias", "frame"], &parameters, act)
        }
        // A constant of each pixel: a sum of uniforms, not Gaussian.
        "fixed-pattern-noise" => {
            let sigma = 0.05 * s * px;
            let mut rng = of.seed.stream("rays/fixed pattern");
            let (width, pixels) = (unit.sensor.camera.width, unit.sensor.camera.pixels());
            let own: Vec<f32> = (0..pixels).map(|_| roundish(&mut rng)).collect();
            bias(name, "sum of four uniforms", "pixel", &[("sigma_px", sigma)], move |s, _| {
                sigma * f64::from(own[s.v as usize * width + s.u as usize])
            })
            .worth(move |ground| ground.of_pixels(sigma))
        }
        // A footprint with soft edges sees two surfaces and mixes their disparities by area. Below
        // strength 1 only part of the light is spread so.
        "edge-mixing" => {
            let (width, part) = (2.0 * s.max(1.0) * px.max(0.5), s.min(1.0));
            let form = "gaussian footprint, mixed in disparity";
            let parameters = [("width_px", width), ("part", part)];
            bias(name, form, "edge-distance", &parameters, move |s, _| {
                let share = part * 0.5 * erfc(s.edge_px.abs() * FRAC_1_SQRT_2 / (0.5 * width));
                s.other_disparity.map_or(0.0, |other| share * (other - s.disparity))
            })
            .within(0.0, width)
        }
        _ => return None,
    })
}

/// A bent board, `half` m from its centre to its end.
fn target_bow(name: &str, of: &Draw<'_>, rng: &mut Stream) -> Cause {
    let half = of.half_m;
    let sagitta = sign(rng) * 0.004 * of.strength;
    let form = lot(&["circle arc", "catenary", "gaussian bump"], rng);
    let radius = (half * half + sagitta * sagitta) / (2.0 * sagitta.abs());
    let lift = move |[p, q]: [f64; 2]| match form {
        "circle arc" => {
            let arc = (radius * radius - p * p).max(0.0).sqrt() - (radius - sagitta.abs());
            sagitta.signum() * arc
        }
        "catenary" => sagitta * (1.0 - ((p / half).cosh() - 1.0) / (1f64.cosh() - 1.0)),
        _ => sagitta * (-(p * p + q * q) / (2.0 * (0.5 * half).powi(2))).exp(),
    };
    let parameters = [("sagitta_m", sagitta), ("span_m", 2.0 * half)];
    Cause::new(name, form, ["bias", "target-position"], &parameters, Act::Lift(Box::new(lift)))
}
