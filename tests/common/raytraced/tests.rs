//! Tests of the geometry without noise, of where and with which sign each cause acts, and of what a
//! set gives away.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::choices::{BY_TIME, BY_VIEW};
use super::confine::Gate;
use super::question::{Asked, ConcealedSet, Pose, World};
use super::shoot::{Pixel, Still};
use super::{Act, CATALOGUE, Cell, OUTSIDE, Order, Set, conceal};
use kinoise::plane::Plane;

pub fn asked(cell: Cell, names: &[&str], nats: Option<f64>, seed: u64) -> Asked {
    let names = names.iter().map(ToString::to_string).collect();
    Asked { world: World::Rays, cell, names, nats, seed, small: true }
}

/// All files of a set by name, as written.
pub fn files(set: &dyn ConcealedSet) -> BTreeMap<String, Vec<u8>> {
    fn walk(root: &Path, folder: &Path, all: &mut BTreeMap<String, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(root, &path, all);
            } else {
                let name = path.strip_prefix(root).unwrap().display().to_string();
                all.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    let (folder, mut all) = (tempfile::tempdir().unwrap(), BTreeMap::new());
    set.write(folder.path()).unwrap();
    walk(folder.path(), folder.path(), &mut all);
    all
}

/// A set with nothing but this cause.
fn bare(name: &str, seed: u64) -> Set {
    let cell = if OUTSIDE.contains(&name) { Cell::Outside } else { Cell::Single };
    let (effects, views, frames) = (vec![name.to_string()], Some(6), Some(4));
    let order = Order { cell, effects, strength: 1.0, seed, views, frames, small: true };
    let mut set = Set::draw(order).unwrap();
    set.causes.drain(..set.known_causes);
    set.known_causes = 0;
    set
}

#[test]
fn a_board_is_a_plane_and_noise_as_large_as_the_unit_says() {
    let mut set = bare("vignetting", 11);
    set.causes.clear();
    let (noisy, sigma) = (Still::new(&set, 0).depth(0), set.unit.clone());
    set.unit.sigma = [0.0, 0.0, 0.0, 0.0, 2.0, 1.39];
    let (plan, camera) = (&set.plans[0], &set.unit.sensor.camera);
    let plane = Plane::from_normal(plan.stage.board.normal, plan.stage.board.reach);
    assert!((plane.theta() - plan.stage.theta).abs() < 1e-9);
    let still = Still::new(&set, 0);
    let (mut n, mut squares) = (0.0, 0.0);
    for (i, z) in still.depth(0).iter().enumerate().filter(|(i, _)| still.pixels[*i].on_board) {
        let (x, y) = camera.ray((i % camera.width) as f64, (i / camera.width) as f64);
        let z = f64::from(*z);
        assert!((z - plane.depth(x, y)).abs() < 1e-5 * z, "pixel {i}: {z}");
        n += 1.0;
        squares += ((f64::from(noisy[i]) - z) / sigma.sigma(z, plan.stage.theta)).powi(2);
    }
    // Ten thousand pixels at least: four standard errors.
    assert!((squares / n - 1.0f64).abs() < 4.0 * (2.0 / n).sqrt(), "{squares} of {n}");
}

#[test]
fn every_cause_changes_what_it_should_and_nothing_else() {
    for name in CATALOGUE.iter().chain(&OUTSIDE) {
        let mut set = bare(name, 11);
        let frame = usize::from(*name != "first-frame");
        let held = |set: &Set| -> Vec<(Vec<Pixel>, Vec<f32>, Vec<f32>)> {
            let still = (0..6).map(|view| Still::new(set, view));
            still.map(|s| (s.pixels.clone(), s.noise(frame), s.depth(frame))).collect()
        };
        let with = held(&set);
        let cause = set.causes.remove(0);
        let without = held(&set);
        assert_eq!(!cause.label.names.is_empty(), CATALOGUE.contains(name));
        let pixels = |of: fn(&Pixel) -> u32| {
            let pairs = with.iter().zip(&without).flat_map(|(a, b)| a.0.iter().zip(&b.0));
            pairs.into_iter().any(|(a, b)| of(a) != of(b))
        };
        let (moves, spreads) = (pixels(|p| p.disparity.to_bits()), pixels(|p| p.sigma.to_bits()));
        let shapes = with.iter().zip(&without).any(|(a, b)| a.1 != b.1);
        let lost = |held: &[(Vec<Pixel>, Vec<f32>, Vec<f32>)]| -> usize {
            held.iter().map(|h| h.2.iter().filter(|z| z.is_nan()).count()).sum()
        };
        assert!(with.iter().zip(&without).any(|(a, b)| a.2 != b.2), "{name} does nothing");
        assert_eq!(lost(&with) > lost(&without), cause.label.statistic == "missing", "{name}");
        match cause.act {
            // A bent board or ray is met at another distance, where sigma differs.
            Act::Ray(_) | Act::Lift(_) => assert!(moves && !shapes, "{name}"),
            Act::Mismatch(_) => assert!(moves && !spreads && !shapes, "{name}"),
            Act::Spread(_) => assert!(!moves && spreads && !shapes, "{name}"),
            Act::Grain(..) => assert!(!moves && !spreads && shapes, "{name}"),
            _ => assert!(!moves && !spreads && !shapes, "{name}"),
        }
    }
}

/// Mean depth on the board shifts in the direction that the label says.
#[test]
fn causes_act_with_the_sign_they_are_labelled_with() {
    let signed = [
        ("radial-disparity-bias", "k_px", -1.0),
        ("disparity-offset", "offset_px", -1.0),
        ("depth-scale", "scale", 1.0),
        ("thermal-drift", "relative", 1.0),
        ("target-bow", "sagitta_m", -1.0),
        ("target-motion", "velocity_mps", 1.0),
        ("seam", "size_px", -1.0),
        ("blob", "size_px", -1.0),
    ];
    let mut both = BTreeSet::new();
    for (name, parameter, side) in signed {
        for seed in 1..5 {
            let mut set = bare(name, seed);
            let depth = |set: &Set| {
                let still = Still::new(set, 3);
                let of = |(z, p): (f32, &Pixel)| if p.on_board { f64::from(z) } else { 0.0 };
                still.depth(3).into_iter().zip(&still.pixels).map(of).sum::<f64>()
            };
            let with = depth(&set);
            let label = set.causes.remove(0).label;
            let value = label.parameters[parameter].as_f64().unwrap();
            let value = if parameter == "scale" { value - 1.0 } else { value };
            assert!((with - depth(&set)) * value * side > 0.0, "{name} {seed}: {value}");
            both.insert(value > 0.0);
        }
    }
    assert_eq!(both.len(), 2, "they go to either side");
}

/// Pixels with the cause and without differ where the truth says, and only there.
#[test]
fn masks_act_where_they_say() {
    let cells = [Cell::FewViews, Cell::Region, Cell::Far, Cell::Late];
    for (cell, seed) in cells.into_iter().flat_map(|c| (0..3).map(move |s| (c, s))) {
        // Each changes single pixels, and all four cells have it.
        let name = ["pixel-locking", "column-banding", "vignetting"][seed as usize];
        let of = asked(cell, &[name], Some(150.0), seed);
        let mut set = Set::asked(&of, Some(10), None).unwrap();
        let last = set.causes.pop().unwrap();
        let label = last.label.clone();
        let plain: Vec<Vec<Pixel>> = (0..10).map(|view| Still::new(&set, view).pixels).collect();
        set.causes.push(last);
        let mut touched = BTreeSet::new();
        for (view, plain) in plain.iter().enumerate() {
            let (plan, camera) = (&set.plans[view], &set.unit.sensor.camera);
            let still = Still::new(&set, view);
            let differ = |i: &usize| plain[*i] != still.pixels[*i] && plain[*i].on_board;
            for i in (0..plain.len()).filter(differ) {
                let (u, v) = ((i % 160) as f64, (i / 160) as f64);
                let (x, y) = camera.ray(u, v);
                let at = match label.also.first().map(String::as_str) {
                    Some("column") => u,
                    Some("row") => v,
                    Some("z") => plan.stage.board.depth(x, y),
                    _ => plan.session_s,
                };
                let within = label.interval.is_none_or(|[a, b]| (a..=b).contains(&at));
                assert!(within, "{cell:?} {seed}: {at}, not {:?}", label.interval);
                touched.insert(view);
            }
        }
        assert!(!touched.is_empty(), "{cell:?} {seed} acts nowhere");
        assert!(cell != Cell::FewViews || touched.len() <= 3, "{touched:?}");
    }
}

/// Whatever a cause acts on, frames change in views where it acts, and in no others by a single bit.
#[test]
fn what_some_views_have_the_others_lack() {
    let by_view = BY_VIEW.map(|name| (Cell::FewViews, name));
    let by_time = BY_TIME.map(|name| (Cell::Late, name));
    for (cell, name) in by_view.into_iter().chain(by_time) {
        let of = asked(cell, &[name], Some(50.0), 3);
        let mut set = Set::asked(&of, Some(8), Some(3)).unwrap();
        let frames = |set: &Set| -> Vec<Vec<u32>> {
            let depth = |view| Still::new(set, view).depth(1).into_iter();
            (0..8).map(|view| depth(view).map(f32::to_bits).collect()).collect()
        };
        let with = frames(&set);
        let cause = set.causes.pop().unwrap();
        let without = frames(&set);
        let touched: Vec<usize> = (0..8).filter(|v| with[*v] != without[*v]).collect();
        let open: Vec<usize> = match cause.only {
            Some(Gate::Views(views)) => views,
            Some(Gate::Late([from, _])) => {
                (0..8).filter(|v| set.plans[*v].session_s > from).collect()
            }
            gate => panic!("{cell:?} {name}: {gate:?}"),
        };
        assert!(!touched.is_empty() && touched.len() < 8, "{cell:?} {name}: {touched:?}");
        assert!(touched.iter().all(|v| open.contains(v)), "{cell:?} {name}: {touched:?} {open:?}");
    }
    let part = Set::asked(&asked(Cell::Region, &["row-noise"], None, 3), Some(8), Some(3));
    let told = part.err().unwrap().to_string();
    assert!(told.contains("cannot be confined to a part of a view"), "{told}");
}

/// The same bytes every time, the cause's name nowhere, no key that a null lacks. One more view changes none
/// of the others and comes after them.
#[test]
fn a_written_set_gives_nothing_away() {
    let of = asked(Cell::FewViews, &["vignetting"], Some(50.0), 5);
    let set = conceal(&of).unwrap();
    let first = files(&*set);
    assert_eq!(first, files(&*conceal(&of).unwrap()));
    let keys = |files: &BTreeMap<String, Vec<u8>>| -> Vec<String> {
        let model: serde_json::Value = serde_json::from_slice(&files["model.json"]).unwrap();
        model.as_object().unwrap().keys().cloned().collect()
    };
    let null = files(&*conceal(&asked(Cell::Null, &[], None, 5)).unwrap());
    assert_eq!(keys(&first), keys(&null));
    for (name, bytes) in first.iter().filter(|(name, _)| !name.ends_with("png")) {
        let text = String::from_utf8_lossy(bytes);
        let given = ["vignetting", "growth", "nats", "hidden", "few"].map(|w| text.contains(w));
        assert!(!given.contains(&true), "{name} says too much");
    }
    let pose = Pose { z_m: 2.9, theta_rad: 0.3, azimuth_rad: 0.8 };
    let (taken, more) = set.with_view(&pose).unwrap().unwrap();
    let more = files(&*more);
    assert!(first.iter().all(|(name, bytes)| more.get(name) == Some(bytes)));
    let last = |files: &BTreeMap<String, Vec<u8>>| {
        files.keys().filter(|name| name.ends_with("depth.txt")).max().cloned()
    };
    assert!(last(&more) > last(&first));
    assert!(taken.z_m == pose.z_m && taken.theta_rad <= pose.theta_rad);
}

/// Exam views: three go beyond the recording; a null's are plain; each cause shows in its statistic.
#[test]
fn exams_show_what_is_concealed() {
    for (cell, names, biased, noisier) in [
        (Cell::Null, &[][..], false, false),
        (Cell::Single, &["radial-disparity-bias"], true, false),
        (Cell::Single, &["slope-noise"], false, true),
        (Cell::Drift, &[], false, true),
    ] {
        let views = conceal(&asked(cell, names, Some(150.0), 4)).unwrap().exam();
        let differ =
            |a: &[f32], b: &[f32]| a.iter().zip(b).any(|(a, b)| a.to_bits() != b.to_bits());
        assert_eq!(views.iter().filter(|v| v.beyond).count(), 3);
        assert_eq!(views.iter().any(|v| differ(&v.depth, &v.plain)), biased, "{cell:?}");
        assert_eq!(views.iter().any(|v| differ(&v.sigma, &v.sigma_plain)), noisier, "{cell:?}");
    }
}
