//! The sets by light: what they hold, and that they are the same every time.

use super::{SWITCHES, seal};
use crate::raytraced::tests_sealed::walkdir;
use crate::{Asked, Cell, Pose, World};

fn asked(cell: Cell, names: &[&str], nats: f64, seed: u64) -> Asked {
    let names = names.iter().map(ToString::to_string).collect();
    Asked { world: World::Light, cell, names, nats: Some(nats), seed, small: true }
}

#[test]
fn every_switch_goes_as_far_as_it_must() {
    for switch in &SWITCHES {
        for nats in [5.0, 15.0, 50.0, 150.0] {
            let truth = seal(&asked(Cell::Single, &[switch.cause], nats, 3)).unwrap().truth();
            let one = &truth.hidden[0];
            assert_eq!(one.form, switch.cause);
            assert_ne!(truth.base["usual"][switch.cause], truth.base["switched"][switch.cause]);
            assert!(one.nats.is_none() && one.parameters.contains_key(switch.cause));
        }
    }
    assert!(seal(&asked(Cell::Single, &["no such cause"], 5.0, 1)).is_err());
    assert!(seal(&asked(Cell::Pair, &[], 5.0, 1)).is_err());
    assert!(seal(&asked(Cell::Null, &[], 5.0, 1)).unwrap().truth().hidden.is_empty());
}

/// Two recordings of the same views with other noise; nothing in their text tells the cause.
#[test]
fn a_set_by_light_is_two_recordings_of_the_same_poses() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let root = folder.path().join(name);
        seal(&asked(Cell::Single, &["lens_k1"], 50.0, 2)).unwrap().write(&root).unwrap();
        let mut files: Vec<(String, Vec<u8>)> = walkdir(&root)
            .into_iter()
            .map(|p| {
                let name = p.strip_prefix(&root).unwrap().display().to_string();
                (name, std::fs::read(&p).unwrap())
            })
            .collect();
        files.sort();
        files
    };
    let files = write("a");
    assert_eq!(files, write("b"), "the same bytes");
    let of = |which: &str| -> Vec<(String, Vec<u8>)> {
        let prefix = format!("{which}/");
        let mine = files.iter().filter(|(name, _)| name.starts_with(&prefix));
        mine.map(|(name, bytes)| (name[prefix.len()..].to_string(), bytes.clone())).collect()
    };
    let (recording, simulated) = (of("recording"), of("simulated"));
    assert_eq!(recording.len() + simulated.len(), files.len(), "nothing else");
    for ((a, bytes), (b, other)) in recording.iter().zip(&simulated) {
        assert_eq!(a, b);
        let image = a.ends_with("png");
        assert_eq!(bytes == other, !image, "{a}");
        let text = String::from_utf8_lossy(bytes).to_lowercase();
        assert!(image || !["lens", "k1", "cause"].iter().any(|w| text.contains(w)), "{a}");
    }
}

/// The views there were stay as they were, to the last byte.
#[test]
fn a_view_more_is_all_that_changes() {
    let folder = tempfile::tempdir().unwrap();
    let set = seal(&asked(Cell::Single, &["lens_k1"], 50.0, 2)).unwrap();
    // Out of the matcher's reach: it is taken as near to it as can be.
    let wanted = Pose { z_m: 4.0, theta_rad: 1.2, azimuth_rad: 0.5 };
    let (taken, more) = set.with_view(&wanted).unwrap().unwrap();
    assert!(taken.z_m < 3.0 && taken.theta_rad < 1.0 && taken.azimuth_rad == 0.5);
    let [before, after] = [("before", &set), ("after", &more)].map(|(name, set)| {
        let root = folder.path().join(name);
        set.write(&root).unwrap();
        let bytes = |p: std::path::PathBuf| {
            (p.strip_prefix(&root).unwrap().display().to_string(), std::fs::read(&p).unwrap())
        };
        walkdir(&root).into_iter().map(bytes).collect::<std::collections::BTreeMap<_, _>>()
    });
    assert!(before.iter().all(|(name, bytes)| after.get(name) == Some(bytes)));
    let new: Vec<&String> = after.keys().filter(|name| !before.contains_key(*name)).collect();
    assert!(!new.is_empty());
    let views = new.iter().map(|name| name.split('/').nth(1));
    let one: std::collections::BTreeSet<_> = views.collect();
    assert_eq!(one.len(), 1, "in recording and in simulated: {new:?}");
}
