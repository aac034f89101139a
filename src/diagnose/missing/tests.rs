use super::*;
use crate::diagnose::missing::cells::Patch;
use crate::diagnose::missing::points::points;
use crate::plane::Plane;
use crate::rng::Stream;
use crate::simulate::kinect_v1;
use crate::terms::{Axis, PixelContext};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

const VIEWS: usize = 14;

/// Cells of views whose pixels are lost by `loss` and by chance: in some views more than in others, and in
/// clumps.
pub fn session(
    share: f64,
    rng: &mut Stream,
    loss: impl Fn(&PixelContext) -> f64,
) -> (Vec<Vec<Patch>>, Camera) {
    let camera = kinect_v1(1).camera;
    let mut normal = {
        let mut own = crate::rng::Seed(rng.random()).stream("normal");
        move || -> f64 { StandardNormal.sample(&mut own) }
    };
    let views = (0..VIEWS).map(|view| {
        let z = 0.8 * (3.5f64 / 0.8).powf(rng.random());
        let theta = (5.0 * (view as f64 + rng.random::<f64>())).to_radians();
        let plane = Plane::tilted(z, theta, rng.random_range(-3.1..3.1));
        let level = normal();
        let clumps: Vec<f64> = (0..48).map(|_| normal()).collect();
        let mut cells = Vec::new();
        for i in 0..192 {
            let (column, row) = (i % 16, i / 16);
            let (u, v) = (40.0 * column as f64 + 20.0, 40.0 * row as f64 + 20.0);
            let (x, y) = camera.ray(u, v);
            let depth = plane.depth(x, y);
            if !(0.3..5.0).contains(&depth) {
                continue;
            }
            let place = PixelContext {
                u,
                v,
                x,
                y,
                z: depth,
                disparity: 40.0 / depth,
                theta: plane.theta(),
                session_s: view as f64,
                radius: f64::hypot(x, y) / 0.7,
                edge: 30.0,
                light: 1.0,
                side: 40.0,
                ..PixelContext::default()
            };
            let by_chance = share * (level + clumps[row / 2 * 8 + column / 2] - 1.0).exp();
            let p = 1.0 - (1.0 - by_chance.min(1.0)) * (1.0 - loss(&place));
            let asked: f64 = 6400.0;
            let drawn = asked * p + (asked * p * (1.0 - p)).sqrt() * normal();
            cells.push(Patch { place, lost: drawn.round().clamp(0.0, asked), asked });
        }
        cells
    });
    (views.collect(), camera)
}

pub fn find(views: &[Vec<Patch>], camera: &Camera, seed: Seed) -> DropoutOutcome {
    find_beside(views, None, camera, seed)
}

fn find_beside(
    views: &[Vec<Patch>],
    twins: Option<&[Vec<Patch>]>,
    camera: &Camera,
    seed: Seed,
) -> DropoutOutcome {
    let of = |value: fn(&PixelContext) -> f64| {
        crate::stats::range(views.iter().flatten().map(|c| value(&c.place)))
    };
    let mut reach = Extent::of(std::iter::empty());
    reach.z = of(|p| p.z);
    reach.theta = of(|p| p.theta);
    reach.session = of(|p| p.session_s);
    reach.light = [1.0, 1.0];
    let mut mine = cells(views, &vec![1.0; views.len()]);
    if let Some(twins) = twins {
        set_expected(&mut mine, &cells(twins, &vec![1.0; twins.len()]), rim_px(camera));
    }
    let seen = DropoutCells {
        cells: mine,
        fine: cells(views, &vec![1.0; views.len()]),
        region_given: vec![true; views.len()],
        second: (0..views.len()).map(|v| v % 2 == 1).collect(),
        beside_twins: twins.is_some(),
    };
    let within = |[near, far]: [f64; 2]| {
        move |c: &Cell<'_>| Some(c.place.z).filter(|z| *z >= near && *z <= far)
    };
    let look = CloseLook {
        // Eq. 1 without its tilt.
        blur: &|z| 0.0015 + 0.00215 * (z - 0.483).powi(2),
        points: &|span| points(&seen.fine, &within(span), span),
        reach: reach.z,
    };
    DropoutSearch { reach: &reach, camera, look, seed }.losses(&seen)
}

/// Loses whole patches, others in every run, as a failing matcher does: a `share` of the patches beyond
/// `far_m`.
fn run(none: &[Vec<Patch>], far_m: f64, share: f64, rng: &mut Stream) -> Vec<Vec<Patch>> {
    let mut views = none.to_vec();
    for far in views.iter_mut().flatten().filter(|c| c.place.z > far_m) {
        let clump = rng.random_bool(share);
        far.lost = if clump { far.asked * rng.random_range(0.02..0.3) } else { 0.0 };
    }
    views
}

#[test]
fn clumps_that_lie_elsewhere_in_another_run_are_no_difference() {
    let [mut alarms, mut seen] = [0; 2];
    for seed in 0..20 {
        let mut rng = Seed(seed).stream("twins");
        let (none, camera) = session(0.0, &mut rng, |_| 0.0);
        let differ = |views: &[Vec<Patch>], twins: &[Vec<Patch>]| {
            let outcome = find_beside(views, Some(twins), &camera, Seed(seed));
            usize::from(!outcome.findings.is_empty())
        };
        let few = [(); 2].map(|()| run(&none, 3.4, 0.3, &mut rng));
        alarms += differ(&few[0], &few[1]);
        seen += differ(&run(&none, 2.8, 0.6, &mut rng), &none);
    }
    println!("{alarms} alarms of 20 where both lose alike, {seen} of 20 where one alone loses");
    // One scatter for all patches gives five alarms. At a level of 0.003 each, two of 20 are one in 600.
    assert!(alarms <= 1 && seen >= 18, "{alarms} {seen}");
}

/// A clump at the far side of the steepest view is no law, wherever the step begins; losses of all steep
/// views are.
#[test]
fn what_one_view_loses_beside_its_twin_is_no_law() {
    let (none, camera) = session(0.0, &mut Seed(2).stream("twins/one"), |_| 0.0);
    let steepest = |view: &[Patch]| view.iter().map(|p| p.place.theta).fold(0.0, f64::max);
    let mut tilts: Vec<f64> = none.iter().map(|v| steepest(v)).collect();
    tilts.sort_by(f64::total_cmp);
    let lost_from = |tilt: f64| {
        let mut views = none.clone();
        for p in views.iter_mut().flatten().filter(|p| p.place.theta >= tilt) {
            p.lost = 0.3 * p.asked;
        }
        find_beside(&views, Some(&none), &camera, Seed(2)).findings.len()
    };
    let n = tilts.len();
    assert_eq!([lost_from(tilts[n - 1]), lost_from(tilts[n - 6]).min(1)], [0, 1]);
}

fn parameter(finding: &Finding, name: &str) -> [f64; 2] {
    ["value", "std_error"].map(|of| finding.parameters[name][of].as_f64().unwrap())
}

/// Half is lost at 62 degrees; the background is lost by chance.
#[test]
fn the_grazing_angle_comes_back() {
    let mut within = 0;
    for seed in 0..12 {
        let mut rng = Seed(seed).stream("grazing");
        let (views, camera) = session(0.002, &mut rng, |p| {
            1.0 / (1.0 + (-(p.theta.to_degrees() - 62.0) / 1.5).exp())
        });
        let outcome = find(&views, &camera, Seed(seed));
        let first = outcome.findings.first().expect("found");
        assert_eq!(first.effect, Some("grazing-dropout"), "{seed}: {:?}", first.alternatives);
        assert!(
            first.p_adjusted.is_some_and(|p| p < 1e-3) && !first.physics.contains("began"),
            "{}",
            first.physics
        );
        let [middle, error] = parameter(first, "theta50_deg");
        assert!((middle - 62.0).abs() < 3.0, "{middle} +- {error}");
        within += usize::from((middle - 62.0).abs() < 2.0 * error);
    }
    // 95 % of 12 are 11; 9 or fewer have a chance of 2 %.
    assert!(within >= 10, "{within} of 12 within two standard errors");
}

/// Gaussian and Gompertz rises, each in its own unit of width. 90 % of 12 are 11; 8 or fewer have a chance of
/// 2 %.
#[test]
fn the_interval_holds_whatever_the_rise() {
    let normal = |t: f64| 0.5 * statrs::function::erf::erfc(-t / 2f64.sqrt());
    let gompertz = |t: f64| (-std::f64::consts::LN_2 * (-t).exp()).exp();
    let rises: [(&str, &dyn Fn(f64) -> f64); 2] = [("normal", &normal), ("gompertz", &gompertz)];
    for (name, rise) in rises {
        let mut held = [0; 2];
        for seed in 0..12 {
            let mut rng = Seed(seed).stream("rise");
            let (middle, width) = (rng.random_range(2.2..3.2), rng.random_range(0.06..0.2));
            let (views, camera) = session(0.002, &mut rng, |p| rise((p.z - middle) / width));
            let outcome = find(&views, &camera, Seed(seed));
            let first = outcome.findings.first().expect("found");
            assert_eq!(first.effect, Some("range-dropout"), "{seed}: {:?}", first.alternatives);
            for (k, (of, truth)) in [("z50_m", middle), ("width_m", width)].into_iter().enumerate()
            {
                let [said, error] = parameter(first, of);
                held[k] += usize::from((said - truth).abs() <= 1.645 * error);
            }
        }
        println!("{name}: {held:?} of 12");
        assert!(held.iter().all(|n| *n >= 9), "{name}: {held:?}");
    }
}

#[test]
fn what_is_too_near_is_lost_on_the_near_side() {
    let mut rng = Seed(3).stream("near");
    let (views, camera) = session(0.002, &mut rng, |p| 1.0 / (1.0 + ((p.z - 1.0) / 0.04).exp()));
    let outcome = find(&views, &camera, Seed(3));
    let first = &outcome.findings[0];
    assert_eq!((first.effect, first.axis), (Some("range-dropout"), Axis::Z));
    let ([middle, error], [width, _]) = (parameter(first, "z50_m"), parameter(first, "width_m"));
    assert!((middle - 1.0).abs() < 3.0 * error.max(0.003), "{middle} +- {error}");
    assert!((width + 0.04).abs() < 0.02, "{width}");
    assert!(first.interval[0] == 0.0 && (first.interval[1] - 1.12).abs() < 0.08);
}

/// A driver's limit, with readings that scatter about it by 1 %, gives a note and no named finding.
#[test]
fn a_hard_end_of_the_range_is_a_note() {
    let mut rng = Seed(6).stream("hard");
    let (views, camera) = session(0.002, &mut rng, |p| 1.0 / (1.0 + ((2.2 - p.z) / 0.013).exp()));
    let outcome = find(&views, &camera, Seed(6));
    assert!(outcome.findings.iter().all(|f| f.axis != Axis::Z), "{:?}", outcome.findings);
    assert!(outcome.notes.len() == 1 && outcome.notes[0].contains("2.2"), "{:?}", outcome.notes);
}

/// Three views cannot show a rule: the outcome says so, and not that there is none.
#[test]
fn too_few_views_are_told() {
    let mut rng = Seed(7).stream("few");
    let (views, camera) = session(0.002, &mut rng, |_| 0.3);
    let outcome = find(&views[..3], &camera, Seed(7));
    assert!(outcome.findings.is_empty());
    assert!(outcome.notes.iter().any(|n| n.contains("and 3 can be used")), "{:?}", outcome.notes);
}

/// The same distances lose nothing before 6.5 s.
#[test]
fn what_begins_in_the_midst_of_the_session_is_told_with_its_time() {
    for seed in 0..3 {
        let mut rng = Seed(seed).stream("late");
        let (views, camera) = session(0.0, &mut rng, |p| {
            let there = f64::from(u8::from(p.session_s > 6.5));
            there / (1.0 + (-(p.z - 1.8) / 0.08).exp())
        });
        let outcome = find(&views, &camera, Seed(seed));
        let first = outcome.findings.first().expect("found");
        assert_eq!(first.effect, Some("range-dropout"), "{seed}");
        assert!(first.physics.contains("It began about 6.5 s"), "{seed}: {}", first.physics);
        let [middle, error] = parameter(first, "z50_m");
        assert!((middle - 1.8).abs() < 3.0 * error.max(0.01), "{middle} +- {error}");
    }
}

/// A band of rows has no name, but it is located.
#[test]
fn rows_that_fail_are_told_by_their_axis() {
    let mut rng = Seed(4).stream("rows");
    let (views, camera) =
        session(0.001, &mut rng, |p| if (200.0..280.0).contains(&p.v) { 0.1 } else { 0.0 });
    let first = &find(&views, &camera, Seed(4)).findings[0];
    assert_eq!((first.effect, first.axis), (None, Axis::Row));
    assert!(first.interval[0] > 150.0 && first.interval[1] < 330.0, "{:?}", first.interval);
}

/// Seeds with a false alarm. 0, 1 or 2 % is lost on average, in clumps, by a factor of e more or less from
/// view to view.
fn alarms(seeds: std::ops::Range<u64>) -> Vec<u64> {
    seeds
        .filter(|&seed| {
            let mut rng = Seed(seed).stream("null");
            let share = [0.0, 0.01, 0.02][seed as usize % 3];
            let (views, camera) = session(share, &mut rng, |_| 0.0);
            !find(&views, &camera, Seed(seed)).findings.is_empty()
        })
        .collect()
}

#[test]
fn losses_without_a_cause_are_none() {
    assert_eq!(alarms(0..6), Vec::<u64>::new());
}

/// False alarms should occur in 0.1 % of recordings: two in 200 have a chance of 2 %, three of 0.1 %.
#[test]
#[ignore = "slow: two hundred recordings"]
fn losses_without_a_cause_are_none_in_two_hundred() {
    let alarms = alarms(0..200);
    println!("{} false alarms", alarms.len());
    assert!(alarms.len() <= 2, "{alarms:?}");
}
