//! Coverage of the parameters' intervals where nature follows another formula of the same physics: ray-traced
//! sets of known strength, effect by effect.

use std::collections::BTreeMap;

use crate::rays::said;
use crate::raytraced::question::{Asked, World};
use crate::raytraced::{Cell, Set, write};

/// Seeds of the sets of each effect at each strength.
const SEEDS: std::ops::Range<u64> = 9100..9104;
const NATS: [f64; 3] = [150.0, 500.0, 5000.0];
const EFFECTS: [(&str, Cell); 7] = [
    ("range-dropout", Cell::Single),
    ("grazing-dropout", Cell::Single),
    ("heavy-tails", Cell::Single),
    ("tilt-axis-anisotropy", Cell::Single),
    ("temporal-correlation", Cell::Single),
    ("spatial-correlation", Cell::Single),
    ("thermal-drift", Cell::Referenced),
];
/// Standard errors on either side that contain 90 % of a Gaussian.
const NINETY_PERCENT: f64 = 1.645;

fn set(effect: &str, cell: Cell, nats: f64, seed: u64) -> Set {
    let names = vec![effect.to_string()];
    let asked = Asked { world: World::Rays, cell, names, nats: Some(nats), seed, small: true };
    Set::asked(&asked, None, None).expect("a set")
}

/// Whether the interval of each parameter reported with an error covers the true value.
fn held(set: &Set) -> Vec<(String, bool)> {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
    write(set, folder.path()).expect("written");
    let model = folder.path().join("model").join(format!("{}.json", set.name));
    let said = said(&folder.path().join(&set.name), &model);
    let truth = set.truth();
    let hidden = &truth["effects"][0];
    let findings = said.json["findings"].as_array().into_iter().flatten();
    let parameters = || hidden["parameters"].as_object().into_iter().flatten();
    let told = findings.filter(|f| f["effect"] == hidden["id"]).flat_map(|f| {
        parameters().filter_map(|(name, truth)| {
            let number = |key: &str| f["parameters"][name][key].as_f64();
            let off = (number("value")? - truth.as_f64()?).abs();
            Some((name.clone(), off <= NINETY_PERCENT * number("std_error")?))
        })
    });
    told.collect()
}

/// Of the 90 % intervals at least 84 % must cover over all, and two thirds of any one parameter's: if all
/// were exact, 200 would fall below with a probability of 0.3 %, and ten of one parameter with 1 % each.
#[test]
fn intervals_hold_whatever_the_formula() {
    let mut by_parameter: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for (effect, cell) in EFFECTS {
        for (nats, seed) in NATS.iter().flat_map(|n| SEEDS.map(move |s| (*n, s))) {
            for (name, held) in held(&set(effect, cell, nats, seed)) {
                let count = by_parameter.entry(format!("{effect} {name}")).or_default();
                *count = [count[0] + usize::from(held), count[1] + 1];
            }
        }
    }
    by_parameter.iter().for_each(|(name, [k, n])| println!("{name}: {k} of {n}"));
    let [k, n] = by_parameter.values().fold([0, 0], |[k, n], c| [k + c[0], n + c[1]]);
    assert!(n >= 60, "{n} parameters were told");
    assert!(k as f64 >= 0.84 * n as f64, "{k} of {n}");
    for (name, [k, n]) in &by_parameter {
        assert!(3 * k >= 2 * n || *n < 6, "{name}: {k} of {n}");
    }
}
