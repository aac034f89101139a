use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::plane::Plane;
use crate::rng::{Seed, Stream};

const VIEWS: usize = 12;
/// Constant share of a frame's variance in a speckle simulator's recordings.
const STILL: f64 = 0.9;
const LEVEL: f64 = 1e-3;

/// Noise of a view with these multiples of either part, measured to 15 % and 5 %; the correlation of its
/// frames falls with the time between them.
fn view([still, changing]: [f64; 2], falls: f64, rng: &mut Stream) -> Structure {
    let mut about = |x: f64, error: f64| -> f64 {
        let normal: f64 = StandardNormal.sample(rng);
        x * (error * normal).exp()
    };
    let (still, changing) = (about(STILL * still, 0.15), about((1.0 - STILL) * changing, 0.05));
    let likeness = still / (still + changing);
    Structure {
        pixels: 6000.0,
        variance_px2: 0.01 * (still + changing),
        lagged: [Some(likeness + about(falls, 0.1)), Some(likeness - about(falls, 0.1)), None],
        ..Structure::default()
    }
}

fn parts(of: [f64; 2], falls: f64, rng: &mut Stream) -> Option<NoiseParts> {
    let real: Vec<Structure> = (0..VIEWS).map(|_| view(of, falls, rng)).collect();
    let twins: Vec<Structure> = (0..VIEWS).map(|_| view([1.0; 2], 0.0, rng)).collect();
    NoiseParts::of(&real, &twins, LEVEL)
}

/// Effect of each cause on the parts, read off 36 recordings each of the speckle simulator.
#[test]
fn each_cause_changes_the_parts_in_its_own_way() {
    let frozen = Some(vec!["frozen-noise"]);
    let moving = Some(vec!["target-motion"]);
    let nameless = Some(Vec::new());
    let table = [
        ("stronger speckle", [1.5, 1.05], 0.0, frozen),
        ("a target that moves", [0.5, 5.5], 0.02, moving),
        ("less light", [1.0, 1.6], 0.0, nameless.clone()),
        ("read noise", [0.95, 2.2], 0.0, nameless.clone()),
        ("more blur", [1.3, 2.0], 0.0, nameless.clone()),
        ("a smaller window", [1.5, 1.5], 0.0, nameless.clone()),
        ("steeper noise, less of it renewed", [1.6, 1.4], 0.0, nameless),
    ];
    for (what, of, falls, names) in table {
        let right = (0..40).filter(|seed| {
            let mut rng = Seed(*seed).stream(what);
            let found = parts(of, falls, &mut rng).and_then(|p| p.finding(None));
            found.map(|f| f.families) == names
        });
        let right = right.count();
        assert!(right >= 37, "{what}: {right} of 40");
    }
}

/// Noise half as large again, beside steps that make 0.8 of the changing part: what stands still has grown by 1.5
/// and what changes by 1.1, and no larger share of the noise stands still.
#[test]
fn steps_that_do_not_grow_are_no_frozen_noise() {
    let frozen = |step_px: f64| {
        let named = (0..40).filter(|seed| {
            let mut rng = Seed(*seed).stream("against/steps");
            let mut views = |of| -> Vec<Structure> {
                let one = |_| {
                    let s = view(of, 0.0, &mut rng);
                    let rounding = step_px.powi(2) / 12.0 / s.variance_px2;
                    let lagged = s.lagged.map(|c| Some(c? / (1.0 - rounding)));
                    Structure { rounding, lagged, ..s }
                };
                (0..VIEWS).map(one).collect()
            };
            let (real, twins) = (views([1.5, 1.1]), views([1.0; 2]));
            let found = NoiseParts::of(&real, &twins, LEVEL).and_then(|p| p.finding(None));
            found.is_some_and(|f| f.families == ["frozen-noise"])
        });
        named.count()
    };
    // Named at 5 %: more than five of forty have a chance of 1.4 %.
    let beside_steps = frozen((12.0 * 0.8 * 0.01 * (1.0 - STILL)).sqrt());
    assert!(beside_steps <= 5, "{beside_steps}");
    let without = frozen(0.0);
    assert!(without > 30, "{without}");
}

/// Frames as like each other whatever lies between them: the velocity has to tell.
#[test]
fn noise_that_stands_still_less_is_a_motion_only_with_a_velocity() {
    let moves = |p| {
        let mut rng = Seed(1).stream("against/moving");
        let found = parts([0.5, 5.5], 0.0, &mut rng)?.finding(Some((0.01, 0.005, p)))?;
        Some(found.families == ["target-motion"])
    };
    assert_eq!((moves(0.003), moves(0.007)), (Some(true), Some(false)), "the better of two");
}

#[test]
fn a_larger_window_shrinks_both_parts_alike_and_the_same_sensor_neither() {
    let (mut shrunk, mut said) = (0, 0);
    for seed in 0..200 {
        let mut rng = Seed(seed).stream("against/window");
        shrunk += usize::from(parts([0.65; 2], 0.0, &mut rng).is_some_and(|p| p.shrink_alike()));
        let same = parts([1.0; 2], 0.0, &mut rng);
        said += usize::from(same.is_some_and(|p| p.shrink_alike() || p.finding(None).is_some()));
    }
    assert!(shrunk >= 190, "{shrunk} of 200");
    // Four tails at 1e-3 each: 0.8 of 200 are expected, more than 4 have a chance of 0.2 %.
    assert!(said <= 4, "{said} of 200 clean ones");
}

/// Views of one pixel from 0.9 m on, in steps of `apart`. The real infrared images are lighter by `more`;
/// each image has a relative error of `error`.
fn lit(more: f64, apart: f64, error: f64, rng: &mut Stream) -> [Vec<Field>; 2] {
    let field = |z: f64, infrared: f64| Field {
        infrared: Some(infrared),
        light: vec![(infrared * z * z) as f32],
        ..Field::unseen(Plane::tilted(z, 0.0, 0.0), 43.5, [1, 1], vec![0])
    };
    let mut pair = |k: usize| {
        let z = 0.9 + apart * k as f64;
        let mut about = |x: f64| -> f64 {
            let normal: f64 = StandardNormal.sample(rng);
            x * (1.0 + error * normal)
        };
        // The image has an offset of its own.
        let pattern = 50.0 + 150.0 / (z * z);
        [field(z, about(pattern + more)), field(z, about(pattern))]
    };
    let pairs: Vec<[Field; 2]> = (0..VIEWS).map(&mut pair).collect();
    let side = |k: usize| pairs.iter().map(|p| p[k].clone()).collect();
    [side(0), side(1)]
}

#[test]
fn light_of_the_room_is_a_constant_and_a_brighter_pattern_is_a_factor() {
    for seed in 0..40 {
        let mut rng = Seed(seed).stream("against/light");
        let [real, twins] = lit(60.0, 0.15, 0.01, &mut rng);
        let found = ambient_light(&real, &twins, LEVEL).expect("60 more everywhere");
        assert_eq!(found.families, ["ambient-light"]);
        let ratio = found.parameters["ratio"]["value"].as_f64().unwrap();
        // 200 at 1 m, including the offset.
        assert!((ratio - 0.25).abs() < 0.1, "{ratio}");
        let [real, twins] = lit(0.0, 0.15, 0.01, &mut rng);
        assert!(ambient_light(&real, &twins, LEVEL).is_none());
        let dimmer: Vec<Field> = twins
            .iter()
            .map(|f| Field { infrared: f.infrared.map(|i| 50.0 + 0.4 * (i - 50.0)), ..f.clone() })
            .collect();
        assert!(ambient_light(&dimmer, &twins, LEVEL).is_none(), "a dimmer pattern");
        assert!(ambient_light(&twins, &dimmer, LEVEL).is_none(), "a brighter one");
        assert!(ambient_light(&real[..3], &twins[..3], LEVEL).is_none(), "three views");
    }
}

/// Views of about equal light whose poses differ by a tenth: the line is flat, without ambient light.
#[test]
fn views_that_are_alike_show_no_light_of_the_room() {
    let said = (0..200).filter(|seed| {
        let mut rng = Seed(*seed).stream("against/alike");
        let [real, twins] = lit(0.0, 0.015, 0.1, &mut rng);
        ambient_light(&real, &twins, LEVEL).is_some()
    });
    let said = said.count();
    assert!(said <= 2, "{said} of 200");
}
