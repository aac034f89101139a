//! Which questions a trial puts, evenly over effects and strengths; and who makes a set of each.

use rand::Rng;
use rand::seq::SliceRandom;

use std::path::Path;

use crate::raytraced::question::{Asked, Cell, ConcealedSet, World};
use crate::raytraced::{self, CATALOGUE, OUTSIDE};
use crate::{real, speckle};
use kinoise::error::{Error, Result};
use kinoise::io::hex;
use kinoise::rng::{Seed, Stream};

/// One question of a trial, and its name that says nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    pub name: String,
    pub asked: Asked,
}

/// A kind of question.
struct Share {
    world: World,
    cell: Cell,
    /// Of about 1,500.
    weight: f64,
    /// Each in turn; by the world's lot where none is named.
    names: &'static [&'static str],
    /// Each in turn.
    nats: &'static [f64],
}

/// Nats over a whole recording. A million readings make 50 nats of a bias of 1 % of the noise, and
/// 5000 of one of 10 %: the upper two are what a user would care about.
const ALL: &[f64] = &[5.0, 15.0, 50.0, 150.0, 500.0, 5000.0];
const UPPER: &[f64] = &[50.0, 150.0, 500.0, 5000.0];
/// Sizes of a cause of the world of light, which has no nats.
const SIZES: &[f64] = &[15.0, 50.0, 150.0];

const fn share(world: World, cell: Cell, weight: f64, nats: &'static [f64]) -> Share {
    Share { world, cell, weight, names: &[], nats }
}

static SHARES: [Share; 18] = [
    share(World::Rays, Cell::Null, 120.0, &[]),
    share(World::Light, Cell::Null, 100.0, &[]),
    share(World::Rays, Cell::Drift, 60.0, UPPER),
    Share { world: World::Rays, cell: Cell::Single, weight: 480.0, names: &CATALOGUE, nats: ALL },
    share(World::Light, Cell::Single, 120.0, SIZES),
    share(World::Rays, Cell::Pair, 120.0, UPPER),
    share(World::Rays, Cell::Triple, 60.0, UPPER),
    Share { world: World::Rays, cell: Cell::Outside, weight: 180.0, names: &OUTSIDE, nats: UPPER },
    share(World::Rays, Cell::Blind, 30.0, &[]),
    share(World::Rays, Cell::Referenced, 30.0, UPPER),
    share(World::Rays, Cell::Mimic, 40.0, UPPER),
    share(World::Rays, Cell::FewViews, 20.0, UPPER),
    share(World::Rays, Cell::Region, 20.0, UPPER),
    share(World::Rays, Cell::Far, 20.0, UPPER),
    share(World::Rays, Cell::Late, 20.0, UPPER),
    share(World::Real, Cell::Amnesia, 30.0, &[]),
    share(World::Real, Cell::Transplant, 15.0, UPPER),
    share(World::Real, Cell::Halves, 10.0, &[]),
];

/// The set that is `asked`; `data` is the folder of the real recordings.
pub fn conceal(asked: &Asked, data: Option<&Path>) -> Result<Box<dyn ConcealedSet>> {
    match (asked.world, data) {
        (World::Rays, _) => raytraced::conceal(asked),
        (World::Light, _) => speckle::conceal(asked),
        (World::Real, Some(data)) => real::conceal(asked, data),
        (World::Real, None) => Err(Error::Argument {
            what: "a set of a real recording was asked for, and no folder of such".into(),
            remedy: "give --data",
        }),
    }
}

/// The questions of a trial of `sets`, in the order in which they are put. With `real`, some are of
/// recordings that a real sensor took.
pub fn plan(sets: usize, seed: u64, real: bool) -> Vec<Planned> {
    let mut rng = Seed(seed).stream("prove/plan");
    let mut asked: Vec<Asked> = Vec::with_capacity(sets);
    for (share, count) in counts(sets, real, &mut rng) {
        asked.extend(questions(share, count, &mut rng));
    }
    asked.shuffle(&mut rng);
    asked.into_iter().enumerate().map(|(i, asked)| planned(i, asked, seed)).collect()
}

fn planned(i: usize, asked: Asked, seed: u64) -> Planned {
    let mut rng = Seed(seed).stream(&format!("prove/set/{i}"));
    // The first 32 bytes once were a salt; without them all sets would be others.
    let (_, name, seed): ([u8; 32], [u8; 6], u64) = rng.random();
    Planned { name: hex(&name), asked: Asked { seed, ..asked } }
}

/// How many of each kind. Nobody can count on the number of empty sets: it is drawn around its share.
fn counts(sets: usize, real: bool, rng: &mut Stream) -> Vec<(&'static Share, usize)> {
    let emptier: f64 = rng.random_range(0.75..1.25);
    let kinds: Vec<(&Share, f64)> = SHARES
        .iter()
        .filter(|s| real || s.world != World::Real)
        .map(|s| {
            let empty = matches!(s.cell, Cell::Null | Cell::Halves);
            (s, s.weight * if empty { emptier } else { 1.0 })
        })
        .collect();
    let total: f64 = kinds.iter().map(|k| k.1).sum();
    let quota: Vec<f64> = kinds.iter().map(|k| sets as f64 * k.1 / total).collect();
    let min = usize::from(sets >= 2 * kinds.len());
    let mut count: Vec<usize> = quota.iter().map(|q| (*q as usize).max(min)).collect();
    // Whoever is furthest below its quota gets the next; whoever is furthest above gives.
    let mut given: usize = count.iter().sum();
    while given != sets {
        let by_need = |a: &usize, b: &usize| {
            let off = |i: &usize| quota[*i] - count[*i] as f64;
            off(a).total_cmp(&off(b))
        };
        let all = 0..count.len();
        if given < sets {
            let Some(i) = all.max_by(by_need) else { break };
            (count[i], given) = (count[i] + 1, given + 1);
        } else {
            let Some(i) = all.filter(|i| count[*i] > min).min_by(by_need) else { break };
            (count[i], given) = (count[i] - 1, given - 1);
        }
    }
    kinds.into_iter().map(|k| k.0).zip(count).collect()
}

/// Any stretch of these covers names and strengths evenly; one image in eight is large.
fn questions(share: &Share, count: usize, rng: &mut Stream) -> Vec<Asked> {
    let mut names: Vec<&str> = share.names.to_vec();
    names.shuffle(rng);
    let (first, large) = (rng.random_range(0..12usize), rng.random_range(0..8usize));
    let together = least_common_multiple(names.len().max(1), share.nats.len().max(1));
    (0..count)
        .map(|i| Asked {
            world: share.world,
            cell: share.cell,
            names: names
                .get(i % names.len().max(1))
                .map(|n| (*n).to_string())
                .into_iter()
                .collect(),
            nats: share.nats.get((first + i + i / together) % share.nats.len().max(1)).copied(),
            seed: 0,
            // Not in step with the strengths.
            small: (i + i / 8 + large) % 8 != 0,
        })
        .collect()
}

fn least_common_multiple(a: usize, b: usize) -> usize {
    (a..=a * b).step_by(a).find(|n| n.is_multiple_of(b)).unwrap_or(a * b)
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    fn tally<K: Ord>(plan: &[Planned], key: impl Fn(&Asked) -> K) -> BTreeMap<K, usize> {
        let mut map = BTreeMap::new();
        plan.iter().for_each(|p| *map.entry(key(&p.asked)).or_insert(0) += 1);
        map
    }

    #[test]
    fn a_plan_holds_every_kind_and_as_many_sets_as_asked_for() {
        assert_eq!(plan(60, 5, true), plan(60, 5, true));
        assert_ne!(plan(60, 5, true), plan(60, 6, true));
        for real in [false, true] {
            let wanted = SHARES.iter().filter(|s| real || s.world != World::Real).count();
            assert_eq!(tally(&plan(60, 9, real), |a| (a.world, a.cell)).len(), wanted);
            for n in [0, 1, 4, 37, 60, 333, 1230] {
                assert_eq!(plan(n, 1, real).len(), n);
            }
        }
    }

    #[test]
    fn effects_and_strengths_are_even_and_the_number_of_empties_varies() {
        let mut p = plan(1230, 3, true);
        let small = p.iter().filter(|p| p.asked.small).count() as f64 / p.len() as f64;
        assert!((0.85..0.9).contains(&small), "{small}");
        let seeds: BTreeSet<_> = p.iter().map(|p| p.asked.seed).collect();
        assert_eq!(seeds.len(), 1230);
        p.retain(|p| p.asked.cell == Cell::Single && p.asked.world == World::Rays);
        let by = tally(&p, |a| (a.names.clone(), a.nats.map(|n| n as u32)));
        assert_eq!(by.len(), 29 * ALL.len());
        let (min, max) = (by.values().min(), by.values().max());
        assert!(max <= min.map(|l| l + 1).as_ref(), "{min:?} {max:?}");
        let empties: BTreeSet<usize> = (0..8)
            .map(|s| plan(300, s, false).iter().filter(|p| p.asked.cell == Cell::Null).count())
            .collect();
        assert!(empties.len() > 3, "{empties:?}");
    }
}
