//! What a sealed set shows, and what it does not.

use super::question::Asked;
use super::shoot::Still;
use super::tests_nats::asked;
use super::{Cell, Set, sealed};

/// The catalogue's id nowhere, no file but those of a recording, and the same for a null.
#[test]
fn a_written_set_tells_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let texts = |name: &str, set: &Asked| {
        let root = folder.path().join(name);
        sealed::seal(set).unwrap().write(&root).unwrap();
        let mut all: Vec<(String, Vec<u8>)> = walkdir(&root)
            .into_iter()
            .map(|path| {
                let name = path.strip_prefix(&root).unwrap().display().to_string();
                (name, std::fs::read(&path).unwrap())
            })
            .collect();
        all.sort();
        all
    };
    let set = asked(Cell::FewViews, &["vignetting"], Some(50.0), 5);
    let first = texts("a", &set);
    assert_eq!(first, texts("b", &set), "the same bytes");
    let null: Vec<_> =
        (0..6).flat_map(|s| texts(&format!("{s}"), &asked(Cell::Null, &[], None, s))).collect();
    let kinds = |files: &[(String, Vec<u8>)]| {
        let mut kinds: Vec<String> = files
            .iter()
            .map(|(name, _)| name.replace(|c: char| c.is_ascii_digit(), "#"))
            .filter(|name| !name.contains("ir"))
            .collect();
        kinds.sort();
        kinds.dedup();
        kinds
    };
    assert!(kinds(&first).iter().all(|kind| kinds(&null).contains(kind)));
    let model = |files: &[(String, Vec<u8>)]| {
        let (_, bytes) = files.iter().find(|(name, _)| name == "model.json").unwrap().clone();
        serde_json::from_slice::<serde_json::Value>(&bytes).unwrap()
    };
    let keys = |v: &serde_json::Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&model(&first)), keys(&model(&null)));
    for (name, bytes) in first.iter().filter(|(name, _)| !name.ends_with("png")) {
        let text = String::from_utf8(bytes.clone()).unwrap();
        for word in ["vignetting", "growth", "nats", "hidden", "few"] {
            assert!(!text.contains(word), "{name} says {word}");
        }
    }
}

pub(crate) fn walkdir(root: &std::path::Path) -> Vec<std::path::PathBuf> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { all.extend(walkdir(&path)) } else { all.push(path) }
    }
    all
}

/// Fields with the cause and without differ where the truth says, and only there.
#[test]
fn masks_act_where_they_say() {
    let cells = [Cell::FewViews, Cell::Region, Cell::Far, Cell::Late];
    for (cell, seed) in cells.into_iter().flat_map(|c| (0..6).map(move |s| (c, s))) {
        let mut set = Set::sealed(&asked(cell, &[], Some(150.0), seed), Some(10), None).unwrap();
        let label = set.causes[set.known_causes].label.clone();
        let last = set.causes.pop().unwrap();
        let plain: Vec<Vec<u32>> = (0..10).map(|v| fields(&set, v)).collect();
        set.causes.push(last);
        let (mut inside, mut outside) = ([0usize; 2], 0);
        for (view, plain) in plain.iter().enumerate() {
            let changed = fields(&set, view);
            let mut touched = false;
            for (i, (a, b)) in changed.iter().zip(plain).enumerate() {
                let depth = set.plans[view].stage.board.depth(
                    ((i % 160) as f64 - set.unit.sensor.camera.cx) / set.unit.sensor.camera.fx,
                    ((i / 160) as f64 - set.unit.sensor.camera.cy) / set.unit.sensor.camera.fy,
                );
                let at = match label.also.first() {
                    Some(&"column") => (i % 160) as f64,
                    Some(&"row") => (i / 160) as f64,
                    Some(&"z") => depth,
                    _ => set.plans[view].session_s,
                };
                let within = label.interval.is_none_or(|[a, b]| (a..=b).contains(&at));
                touched |= a != b;
                // Past the board's edge the wall may lie beyond the distance.
                let wall = cell == Cell::Far && set.plans[view].stage.wall.is_some();
                outside += usize::from(a != b && !within && !wall);
            }
            inside[usize::from(touched)] += 1;
        }
        assert_eq!(outside, 0, "{cell:?} {seed}: {:?}", label.interval);
        assert!(inside[1] > 0, "{cell:?} {seed} acts nowhere");
        let few = (cell != Cell::FewViews) || inside[1] <= 3;
        assert!(few, "{inside:?}");
    }
}

fn fields(set: &Set, view: usize) -> Vec<u32> {
    let still = Still::new(set, view);
    let loss = still.loss();
    let all = still.disparity.iter().zip(&still.sigma).zip(loss);
    all.map(|((a, b), c)| a.to_bits() ^ b.to_bits().rotate_left(7) ^ c.to_bits().rotate_left(13))
        .collect()
}

/// Exam views: beyond is beyond, nothing is lost but what lies off the board, and a null's views are
/// plain.
#[test]
fn exams_show_what_is_concealed() {
    let views =
        |cell, names: &[&str]| sealed::seal(&asked(cell, names, Some(150.0), 4)).unwrap().exam();
    for view in views(Cell::Null, &[]) {
        assert!(same(&view.depth, &view.plain) && same(&view.sigma, &view.sigma_plain));
        assert!(view.depth.iter().any(|z| z.is_finite()));
    }
    let biased = views(Cell::Single, &["radial-disparity-bias"]);
    assert_eq!(biased.iter().filter(|v| v.beyond).count(), 3);
    assert!(biased.iter().all(|v| !same(&v.depth, &v.plain) && same(&v.sigma, &v.sigma_plain)));
    let noisy = views(Cell::Single, &["slope-noise"]);
    assert!(noisy.iter().all(|v| same(&v.depth, &v.plain)));
    assert!(noisy.iter().any(|v| !same(&v.sigma, &v.sigma_plain)));
    let aged = views(Cell::Drift, &[]);
    assert!(aged.iter().all(|v| same(&v.depth, &v.plain) && !same(&v.sigma, &v.sigma_plain)));
}

fn same(a: &[f32], b: &[f32]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}
