//! Oracles for what is done to words, and for what it gains.

use serde_json::Map;

use super::change::{Graft, There};
use super::gain::{gain, strength_for};
use super::scene::{Camera, Scene};
use super::tests::known;
use crate::raytraced::borrow::{Window, fresh};
use crate::raytraced::{Act, Cause, Clock, Label, Trace};
use kinoise::frame::{DepthCode, Frame};
use kinoise::model::{Form, NoiseModel, SigmaModel};
use kinoise::plane::Plane;
use kinoise::rng::Seed;
use kinoise::simulate::kinect_v1;

const CODE: DepthCode = DepthCode::Disparity { offset: 3.33, slope: -0.00307, invalid: 2047 };

fn cause(statistic: &'static str, act: Act) -> Cause {
    let label = Label {
        id: None,
        form: "for the test",
        statistic,
        axis: "z",
        also: &[],
        interval: None,
        parameters: Map::new(),
    };
    Cause { label, act, trace: Trace::Field }
}

fn unit() -> (kinoise::view::Sensor, NoiseModel) {
    let mut sensor = kinect_v1(2);
    sensor.code = CODE;
    let model = NoiseModel {
        sensor: None,
        sigma: SigmaModel::published(Form::Khoshelham, &[1.4e-3], SigmaModel::khoshelham().domain),
        effects: Vec::new(),
        fit: kinoise::model::FitSummary::default(),
        provenance: kinoise::model::Provenance::default(),
    };
    (sensor, model)
}

/// Mean, variance and correlation between neighbours.
fn statistics(field: &[f64], width: usize) -> [f64; 3] {
    let n = field.len() as f64;
    let mean = field.iter().sum::<f64>() / n;
    let variance = field.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    let pairs = (0..field.len() - 1).filter(|i| (i + 1) % width > 0);
    let lagged = pairs.map(|i| (field[i] - mean) * (field[i + 1] - mean)).sum::<f64>() / n;
    [mean, variance, lagged / variance]
}

/// Noise that hangs together, as stored words with and without an error of 0.37 of a step: what is
/// added afterwards is told from what was there before the rounding by nothing. The mean of 10 fields
/// has a standard error of 0.002 steps; drawn blindly the variance would be 0.17 too large.
#[test]
fn an_error_added_to_words_is_as_if_it_had_come_before_them() {
    let (sensor, model) = unit();
    let camera = Camera::new(&sensor, &model);
    let (width, height, fb) = (320, 240, camera.disparity_px_m());
    let plane = Plane::tilted(1.2, 0.3, 0.4);
    let step_px = fb * 0.00307;
    let by = 0.37 * step_px;
    let scene = Scene::new(&camera, plane, 0.0);
    let exact: Vec<f64> =
        (0..width * height).map(|i| (fb / scene.site(i, None).z / fb - 3.33) / -0.00307).collect();
    let mut sums = [[0.0; 3]; 2];
    for view in 0..10 {
        let mut noise = fresh(Seed(8), view, 0, width * height);
        Window::bell(6.0).blur(&mut noise, width);
        let stored = |shift: f64| -> Vec<u16> {
            exact
                .iter()
                .zip(&noise)
                .map(|(e, n)| (e + 0.45 * f64::from(*n) + shift).round() as u16)
                .collect()
        };
        let graft = Graft {
            causes: vec![cause("bias", Act::Mismatch(Box::new(move |_, _| by)))],
            seed: Seed(view as u64),
            window_px: 1.0,
        };
        let clock = Clock { seed: Seed(1), view, frame: 0, view_s: 0.0, width };
        let frame = Frame { width, height, raw: stored(0.0) };
        let changed = graft.apply(&scene, &vec![true; width * height], &frame, &clock);
        for (sum, words) in sums.iter_mut().zip([changed.raw, stored(-0.37)]) {
            let field: Vec<f64> =
                words.iter().zip(&exact).map(|(w, e)| f64::from(*w) - e).collect();
            let found = statistics(&field, width);
            sum.iter_mut().zip(found).for_each(|(s, x)| *s += x / 10.0);
        }
    }
    let [added, before] = sums;
    assert!((added[0] + 0.37).abs() < 0.01, "{added:?}");
    assert!((added[0] - before[0]).abs() < 0.01, "{added:?} {before:?}");
    assert!((added[1] / before[1] - 1.0).abs() < 0.06, "{added:?} {before:?}");
    assert!((added[2] - before[2]).abs() < 0.05, "{added:?} {before:?}");
}

/// Twice the standard deviation is four times the variance; a tenth of the pixels is lost.
#[test]
fn more_noise_and_fewer_answers() {
    let (sensor, model) = unit();
    let camera = Camera::new(&sensor, &model);
    let (width, height) = (320, 240);
    let scene = Scene::new(&camera, Plane::tilted(2.0, 0.0, 0.0), 0.0);
    let sigma = scene.expected(0, &scene.site(0, None), &mut Vec::new())[1];
    // Khoshelham's 1.4 mm at 1 m.
    assert!((sigma / (1.4e-3 * camera.disparity_px_m()) - 1.0).abs() < 1e-9);
    let word = CODE.raw(2.0);
    let frame = Frame { width, height, raw: vec![word; width * height] };
    let causes = vec![
        cause("variance", Act::Spread(Box::new(|_, _| 2.0))),
        cause("missing", Act::Loss(Box::new(|_, _| 0.1))),
    ];
    let graft = Graft { causes, seed: Seed(3), window_px: 1.0 };
    let there = graft.there(&scene, &scene.site(7, None));
    assert_eq!(there, There { shift: 0.0, spread: 2.0, tremble: 0.0, loss: there.loss });
    assert!((there.loss - 0.1).abs() < 1e-12);
    let clock = Clock { seed: Seed(1), view: 0, frame: 0, view_s: 0.0, width };
    let words = graft.apply(&scene, &vec![true; width * height], &frame, &clock).raw;
    let kept: Vec<f64> =
        words.iter().filter(|w| **w != 2047).map(|w| f64::from(*w) - f64::from(word)).collect();
    let lost = 1.0 - kept.len() as f64 / words.len() as f64;
    // A standard error of 0.001.
    assert!((lost - 0.1).abs() < 0.005, "{lost}");
    // Three sigma squared come on top; the places within the step and the rounding leave 1/12 each.
    let [_, variance, _] = statistics(&kept, width);
    let step_px = camera.disparity_px_m() * 0.00307;
    let expected = 3.0 * (sigma / step_px).powi(2) + 1.0 / 6.0;
    assert!((variance / expected - 1.0).abs() < 0.03, "{variance} {expected}");
}

/// What a plane takes up gains nothing; a known wave gains its energy over twice the variance.
#[test]
fn the_gain_of_a_known_error() {
    let full = known();
    let camera = Camera::new(&full.recording.sensor, &full.model);
    let views: Vec<usize> = (0..full.recording.views.len()).collect();
    let of = |act: Act| {
        let graft = Graft { causes: vec![cause("bias", act)], seed: Seed(1), window_px: 1.0 };
        gain(&graft, &full, &camera, &views)
    };
    let affine = of(Act::Mismatch(Box::new(|s, _| 0.3 + 0.2 * s.x - 0.1 * s.y)));
    assert!(affine.nats < 1e-6, "{}", affine.nats);
    let wave = |a: f64| of(Act::Mismatch(Box::new(move |s, _| a * (0.9 * s.u).sin()))).nats;
    assert!((wave(0.02) / wave(0.01) - 4.0).abs() < 1e-6);
    let a = strength_for(wave(0.05), wave);
    assert!((a / 0.05 - 1.0).abs() < 1e-3, "{a}");
    let lost = of(Act::Loss(Box::new(|_, _| 0.25)));
    assert!((lost.lost - 0.25).abs() < 1e-12 && lost.nats == 0.0);
}
