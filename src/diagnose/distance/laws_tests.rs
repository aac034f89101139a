//! References of a tilted target, read where the axis was assumed to meet it.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::camera::Camera;
use crate::diagnose::distance::reference::findings;
use crate::diagnose::joint::anchor::families;
use crate::diagnose::views::known::KnownTerms;
use crate::rng::{Seed, Stream};
use crate::terms::{Basis, Coordinate, Modulation, Term};

const PX_M: f64 = 43.5;
/// Standard error of a reference, m.
const ERROR_M: f64 = 0.0008;

/// Three rows of distances: frontal, turned about one axis, then about the other. The axis meets the target
/// two angles away from where it was assumed to, and the disparity is off by `offset_px`. `order` gives each
/// view's place in the session.
fn references(
    offset_px: f64,
    angles: [f64; 2],
    order: fn(usize) -> usize,
    seed: u64,
) -> Vec<ReferencedView> {
    let mut rng = Seed(seed).stream("laws");
    let of = |k: usize| {
        let z = 0.8 + 0.3 * (k % 8) as f64;
        let slope = [[0.0, 0.0], [1.2, 0.05], [0.02, -1.2]][k / 8];
        let noise: f64 = StandardNormal.sample(&mut rng);
        let turned = z * (angles[0] * slope[0] + angles[1] * slope[1]);
        let off = turned - z * z * offset_px / PX_M + ERROR_M * noise;
        let (session_s, in_second_half) = (60.0 * order(k) as f64, k % 2 == 1);
        ReferencedView {
            z,
            slope,
            off,
            own_m: 0.0,
            session_s,
            px_m: PX_M,
            sigma_m: 0.002 * z * z,
            in_second_half,
        }
    };
    (0..24).map(of).collect()
}

/// Names found and their offsets, px, beside a target bent by this much.
fn found(checked: &[ReferencedView], bent_m: f64) -> Vec<(Option<&'static str>, f64)> {
    let laws = laws(checked, bent_m, &[]);
    let found = findings(&laws, &KnownTerms::default(), 1.0, 0.003, Seed(1));
    found.iter().map(|f| (f.effect, f.value("offset_px").unwrap_or(f64::NAN))).collect()
}

/// In the order of the session, these would look like a drift.
#[test]
fn a_target_read_beside_the_axis_is_no_law() {
    for seed in 0..8 {
        let checked = references(0.0, [-0.006, 0.003], |k| k, seed);
        assert_eq!(found(&checked, 0.0), [], "seed {seed}");
    }
}

/// Beside nothing, beside the angles, and beside a bend. Taken in no order of distance, so that no drift can
/// look like it.
#[test]
fn an_offset_keeps_its_size_beside_it() {
    for seed in 0..8 {
        for (angles, bent_m, tolerance) in
            [([0.0; 2], 0.0, 0.01), ([-0.006, 0.003], 0.0, 0.01), ([0.0; 2], 0.004, 0.012)]
        {
            let mut checked = references(0.06, angles, |k| 7 * k % 24, seed);
            checked.iter_mut().for_each(|c| c.off += bent_m);
            let told = found(&checked, bent_m);
            let &[(effect, offset_px)] = &told[..] else { panic!("seed {seed}: {told:?}") };
            assert_eq!(effect, Some("disparity-offset"));
            assert!((offset_px - 0.06).abs() < tolerance, "seed {seed}: {offset_px}");
        }
    }
}

/// A bowl that has an unknown constant takes up an offset of the disparity, but no scale.
#[test]
fn beside_an_open_constant_an_offset_is_no_law_and_a_scale_is() {
    let bowl = Basis::powers(Coordinate::RadiusSquared, 1, Modulation::One);
    let open = families([Term::bias(bowl, vec![0.2])].iter(), &Camera::centred(160, 120, 145.0));
    for seed in 0..4 {
        let mut checked = references(0.06, [0.0; 2], |k| 7 * k % 24, seed);
        let told = |checked: &[ReferencedView], open: &[Family]| {
            let laws = laws(checked, 0.0, open);
            let found = findings(&laws, &KnownTerms::default(), 1.0, 0.003, Seed(1));
            found.iter().map(|f| f.effect).collect::<Vec<_>>()
        };
        assert_eq!(told(&checked, &[]), [Some("disparity-offset")], "seed {seed}");
        assert_eq!(told(&checked, &open), [], "seed {seed}");
        checked.iter_mut().for_each(|c| c.off += 0.02 * c.z);
        assert_eq!(told(&checked, &open), [Some("depth-scale")], "seed {seed}");
    }
}

/// Where a law moves distances by some per cent, its square shows too.
#[test]
fn a_large_law_has_its_own_size() {
    let noise = |rng: &mut Stream| 0.1 * ERROR_M * rng.sample::<f64, _>(StandardNormal);
    type Seen = fn(f64) -> f64;
    let cases: [(&str, f64, Seen); 2] = [
        ("disparity-offset", 0.5, |z| PX_M / (PX_M / z + 0.5)),
        ("depth-scale", 0.03, |z| 1.03 * z),
    ];
    for (family, truth, seen) in cases {
        let mut rng = Seed(2).stream(family);
        let of = |k: usize| {
            let z = 0.8 + 0.1 * (7 * k % 24) as f64;
            let seen = seen(z) + noise(&mut rng);
            ReferencedView {
                session_s: 60.0 * k as f64,
                ..ReferencedView::ahead(seen, seen - z, PX_M)
            }
        };
        let checked: Vec<ReferencedView> = (0..24).map(of).collect();
        let told = laws(&checked, 0.0, &[]);
        let [size, error] = told.iter().find(|l| l.family == family).unwrap().estimate;
        assert!((size - truth).abs() < 3.0 * error, "{family}: {size} +- {error}");
        assert!(error < 0.01 * truth, "{family}: {error}");
    }
}

/// The plane of a bent board is off the place that was measured, equally at all distances.
#[test]
fn a_bent_target_is_no_law() {
    let mut alone = 0;
    for seed in 0..8 {
        let mut checked = references(0.0, [0.0; 2], |k| 7 * k % 24, seed);
        checked.iter_mut().for_each(|c| c.off += 0.004);
        alone += found(&checked, 0.0).len();
        assert_eq!(found(&checked, 0.004), [], "seed {seed}");
    }
    assert!(alone > 0, "without knowing of the bend there is no law either");
}

/// Views whose own distance is less certain the farther they are, like the references of two recordings that
/// are compared. Of 400 sessions without a law 1.2 exceed the level; 7 or more have a chance of 4e-4. If all
/// counted as equally certain, 23 would.
#[test]
fn far_views_that_are_less_sure_are_no_law() {
    let own = |z: f64| 0.003 * z * z / 4.0;
    let sessions = |known: bool| {
        let told = (0..400).filter(|&seed| {
            let mut rng = Seed(seed).stream("less sure");
            let view = |k: usize| {
                let z = 0.8 * 1.2f64.powi(7 * k as i32 % 11);
                let noise: f64 = StandardNormal.sample(&mut rng);
                let session_s = 60.0 * k as f64;
                let ahead = ReferencedView::ahead(z, own(z) * noise, PX_M);
                ReferencedView { own_m: if known { own(z) } else { 0.0 }, session_s, ..ahead }
            };
            !found(&(0..11).map(view).collect::<Vec<_>>(), 0.0).is_empty()
        });
        told.count()
    };
    let (said, unsaid) = (sessions(true), sessions(false));
    println!("{said} of 400, {unsaid} were all as sure");
    assert!(said < 7 && unsaid >= 7, "{said} of 400, and {unsaid}");
}

/// Six references of 3 mm each, and no law: the stated errors hold nine in ten of 400 scales. 0.86 is what 400 draws
/// of nine in ten fall below with a chance of 0.6 %; without Student's quantile it is three in four.
#[test]
fn errors_of_few_references_are_wide() {
    let mut rng = Seed(4).stream("laws/few");
    let held = (0..400).filter(|_| {
        let one = |k: usize| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            ReferencedView::ahead(0.8 + 0.5 * k as f64, 0.003 * noise, PX_M)
        };
        let checked: Vec<ReferencedView> = (0..6).map(one).collect();
        let all = laws(&checked, 0.0, &[]);
        let [scale, error] = all.iter().find(|l| l.family == "depth-scale").unwrap().estimate;
        scale.abs() <= 1.645 * error
    });
    let held = held.count();
    assert!((344..=392).contains(&held), "{held} of 400");
}
