//! The questions of a trial, spread evenly over effects and strengths, and the maker of each set.

use std::path::Path;
use std::sync::Arc;

use rand::Rng;
use rand::seq::SliceRandom;

use crate::proof::Order;
use crate::raytraced::question::{Asked, Cell, ConcealedSet, World};
use crate::raytraced::{self, CATALOGUE, OUTSIDE};
use crate::real::{self, Full};
use crate::speckle;
use kinoise::error::Result;
use kinoise::io::hex;
use kinoise::rng::{Seed, Stream};

/// One question of a trial, with a name that reveals nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    pub name: String,
    pub asked: Asked,
}

/// A kind of question.
struct Share {
    world: World,
    cell: Cell,
    /// Share of the trial; all weights sum to about 1,500.
    weight: f64,
    /// Used in turn; where empty, the world chooses at random.
    names: &'static [&'static str],
    /// Used in turn.
    nats: &'static [f64],
}

/// Strengths, nats over a whole recording. With a million readings, a bias of 1 % of the noise is worth 50
/// nats and one of 10 % is worth 5000: the upper two are what a user would care about.
const ALL: &[f64] = &[5.0, 15.0, 50.0, 150.0, 500.0, 5000.0];
const UPPER: &[f64] = &[50.0, 150.0, 500.0, 5000.0];
/// Sizes of a cause in the light world, which has no nats.
const SIZES: &[f64] = &[15.0, 50.0, 150.0];

const fn share(world: World, cell: Cell, weight: f64, nats: &'static [f64]) -> Share {
    Share { world, cell, weight, names: &[], nats }
}

static SHARES: [Share; 17] = [
    share(World::Rays, Cell::Null, 120.0, &[]),
    share(World::Light, Cell::Null, 100.0, &[]),
    share(World::Rays, Cell::Drift, 60.0, UPPER),
    Share { names: &CATALOGUE, ..share(World::Rays, Cell::Single, 480.0, ALL) },
    share(World::Light, Cell::Single, 120.0, SIZES),
    share(World::Rays, Cell::Pair, 120.0, UPPER),
    share(World::Rays, Cell::Triple, 60.0, UPPER),
    Share { names: &OUTSIDE, ..share(World::Rays, Cell::Outside, 180.0, UPPER) },
    share(World::Rays, Cell::Blind, 30.0, &[]),
    share(World::Rays, Cell::Referenced, 30.0, UPPER),
    share(World::Rays, Cell::Mimic, 40.0, UPPER),
    share(World::Rays, Cell::FewViews, 20.0, UPPER),
    share(World::Rays, Cell::Region, 20.0, UPPER),
    share(World::Rays, Cell::Far, 20.0, UPPER),
    share(World::Rays, Cell::Late, 20.0, UPPER),
    share(World::Real, Cell::Amnesia, 30.0, &[]),
    share(World::Real, Cell::Halves, 10.0, &[]),
];

/// Learns the real recordings in the folder `data`, if any of these questions needs one.
pub fn learn(planned: &[Planned], data: Option<&Path>) -> Result<Vec<Arc<Full>>> {
    let data = data.filter(|_| planned.iter().any(|p| p.asked.world == World::Real));
    data.map_or(Ok(Vec::new()), real::learn)
}

/// Makes the set that is `asked`; a real one is made from one of the `known` recordings.
pub fn conceal(asked: &Asked, known: &[Arc<Full>]) -> Result<Box<dyn ConcealedSet>> {
    match asked.world {
        World::Rays => raytraced::conceal(asked),
        World::Light => speckle::conceal(asked),
        World::Real => real::conceal(asked, known),
    }
}

/// The questions of a trial, in the order in which they are asked.
pub fn plan(order: &Order) -> Vec<Planned> {
    let mut rng = Seed(order.seed).stream("prove/plan");
    let mut asked: Vec<Asked> = Vec::with_capacity(order.sets);
    for (share, count) in counts(order, &mut rng) {
        asked.extend(questions(share, count, &mut rng));
    }
    asked.shuffle(&mut rng);
    let planned = |(i, asked)| {
        let mut rng = Seed(order.seed).stream(&format!("prove/set/{i}"));
        // The first 32 bytes were once a salt; without drawing them all sets would change.
        let (_, name, seed): ([u8; 32], [u8; 6], u64) = rng.random();
        Planned { name: hex(&name), asked: Asked { seed, ..asked } }
    };
    asked.into_iter().enumerate().map(planned).collect()
}

/// Number of questions of each kind. The number of empty sets is drawn around its share, so that nobody
/// can rely on it.
fn counts(order: &Order, rng: &mut Stream) -> Vec<(&'static Share, usize)> {
    let emptier: f64 = rng.random_range(0.75..1.25);
    let weight = |s: &Share| match s.cell {
        Cell::Null | Cell::Halves => s.weight * emptier,
        _ => s.weight,
    };
    let kinds: Vec<&Share> =
        SHARES.iter().filter(|s| order.real || s.world != World::Real).collect();
    let total: f64 = kinds.iter().map(|s| weight(s)).sum();
    let quota: Vec<f64> = kinds.iter().map(|s| order.sets as f64 * weight(s) / total).collect();
    let min = usize::from(order.sets >= 2 * kinds.len());
    let mut count: Vec<usize> = quota.iter().map(|q| (*q as usize).max(min)).collect();
    // The kind furthest below its quota gets one more; the kind furthest above gives one up.
    loop {
        let given: usize = count.iter().sum();
        let off = |i: &usize| quota[*i] - count[*i] as f64;
        let by_need = |a: &usize, b: &usize| off(a).total_cmp(&off(b));
        let all = 0..count.len();
        if given < order.sets {
            let Some(i) = all.max_by(by_need) else { break };
            count[i] += 1;
        } else {
            let givers = all.filter(|i| given > order.sets && count[*i] > min);
            let Some(i) = givers.min_by(by_need) else { break };
            count[i] -= 1;
        }
    }
    kinds.into_iter().zip(count).collect()
}

/// Questions of one kind: any run of them covers names and strengths evenly; one image in eight is large.
fn questions(share: &Share, count: usize, rng: &mut Stream) -> Vec<Asked> {
    let mut names: Vec<&str> = share.names.to_vec();
    names.shuffle(rng);
    let (first, large) = (rng.random_range(0..12usize), rng.random_range(0..8usize));
    let (n, strengths) = (names.len().max(1), share.nats.len().max(1));
    let together = (1..=strengths).map(|k| k * n).find(|m| m.is_multiple_of(strengths));
    let together = together.unwrap_or(n * strengths);
    let question = |i: usize| Asked {
        world: share.world,
        cell: share.cell,
        names: names.get(i % n).map(ToString::to_string).into_iter().collect(),
        nats: share.nats.get((first + i + i / together) % strengths).copied(),
        seed: 0,
        // Out of step with the strengths.
        small: !(i + i / 8 + large).is_multiple_of(8),
    };
    (0..count).map(question).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;

    fn of(sets: usize, seed: u64, real: bool) -> Vec<Planned> {
        plan(&Order { sets, seed, real })
    }

    fn tally<K: Ord>(plan: &[Planned], key: impl Fn(&Asked) -> K) -> BTreeMap<K, usize> {
        let mut map = BTreeMap::new();
        plan.iter().for_each(|p| *map.entry(key(&p.asked)).or_insert(0) += 1);
        map
    }

    #[test]
    fn a_plan_holds_every_kind_and_as_many_sets_as_asked_for() {
        assert_eq!(of(60, 5, true), of(60, 5, true));
        assert_ne!(of(60, 5, true), of(60, 6, true));
        for real in [false, true] {
            let wanted = SHARES.iter().filter(|s| real || s.world != World::Real).count();
            assert_eq!(tally(&of(60, 9, real), |a| (a.world, a.cell)).len(), wanted);
            for n in [0, 1, 4, 37, 60, 333, 1230] {
                assert_eq!(of(n, 1, real).len(), n);
            }
        }
    }

    #[test]
    fn effects_and_strengths_are_even_and_the_number_of_empties_varies() {
        let mut p = of(1230, 3, true);
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
            .map(|s| of(300, s, false).iter().filter(|p| p.asked.cell == Cell::Null).count())
            .collect();
        assert!(empties.len() > 3, "{empties:?}");
    }
}
