//! Which questions a trial puts: shares of diagnosis.md 4.3, evenly over effects and strengths.

use rand::Rng;
use rand::seq::SliceRandom;

use crate::raytraced as rays;
use crate::raytraced::question::{Asked, Cell, World};
use kinoise::io::hex;
use kinoise::rng::{Seed, Stream};

/// One question of a trial, its name that says nothing, and the salt of its seal.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    pub name: String,
    /// 32 bytes, hexadecimal.
    pub salt: String,
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
    Share {
        world: World::Rays,
        cell: Cell::Single,
        weight: 480.0,
        names: &rays::CATALOGUE,
        nats: ALL,
    },
    share(World::Light, Cell::Single, 120.0, SIZES),
    share(World::Rays, Cell::Pair, 120.0, UPPER),
    share(World::Rays, Cell::Triple, 60.0, UPPER),
    Share {
        world: World::Rays,
        cell: Cell::Outside,
        weight: 180.0,
        names: &rays::OUTSIDE,
        nats: UPPER,
    },
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
    let salt: [u8; 32] = rng.random();
    let name: [u8; 6] = rng.random();
    let seed = rng.random();
    Planned { name: hex(&name), salt: hex(&salt), asked: Asked { seed, ..asked } }
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
    let least = usize::from(sets >= 2 * kinds.len());
    let mut count: Vec<usize> = quota.iter().map(|q| (*q as usize).max(least)).collect();
    // Whoever is furthest below its quota gets the next; whoever is furthest above gives.
    loop {
        let given: usize = count.iter().sum();
        let off = |i: &usize| quota[*i] - count[*i] as f64;
        let by_need = |a: &usize, b: &usize| off(a).total_cmp(&off(b));
        match given.cmp(&sets) {
            std::cmp::Ordering::Equal => break,
            std::cmp::Ordering::Less => {
                let Some(i) = (0..count.len()).max_by(by_need) else { break };
                count[i] += 1;
            }
            std::cmp::Ordering::Greater => {
                let Some(i) = (0..count.len()).filter(|i| count[*i] > least).min_by(by_need) else {
                    break;
                };
                count[i] -= 1;
            }
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
    let (mut x, mut y) = (a, b);
    while y > 0 {
        (x, y) = (y, x % y);
    }
    a / x * b
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn tally<K: Ord>(plan: &[Planned], key: impl Fn(&Asked) -> K) -> BTreeMap<K, usize> {
        let mut map = BTreeMap::new();
        plan.iter().for_each(|p| *map.entry(key(&p.asked)).or_insert(0) += 1);
        map
    }

    #[test]
    fn the_same_seed_gives_the_same_plan_and_another_gives_another() {
        assert_eq!(plan(60, 5, true), plan(60, 5, true));
        assert_ne!(plan(60, 5, true), plan(60, 6, true));
    }

    #[test]
    fn sixty_sets_hold_every_kind_and_any_number_comes_out_as_asked() {
        for real in [false, true] {
            let p = plan(60, 9, real);
            let wanted = SHARES.iter().filter(|s| real || s.world != World::Real).count();
            assert_eq!(tally(&p, |a| (a.world, a.cell)).len(), wanted);
            for n in [0, 1, 4, 37, 60, 333, 1230] {
                assert_eq!(plan(n, 1, real).len(), n);
            }
        }
    }

    #[test]
    fn effects_and_strengths_are_even_and_sizes_are_as_agreed() {
        let p = plan(1230, 3, true);
        let singles: Vec<Planned> = p
            .iter()
            .filter(|p| p.asked.cell == Cell::Single && p.asked.world == World::Rays)
            .cloned()
            .collect();
        let by = tally(&singles, |a| (a.names.clone(), a.nats.map(|n| n as u32)));
        assert_eq!(by.len(), 29 * ALL.len());
        let (least, most) = (by.values().min(), by.values().max());
        assert!(most <= least.map(|l| l + 1).as_ref(), "{least:?} {most:?}");
        let small = p.iter().filter(|p| p.asked.small).count() as f64 / p.len() as f64;
        assert!((0.85..0.9).contains(&small), "{small}");
        for level in tally(&singles, |a| a.nats.map(|n| n as u32)).keys() {
            let of: Vec<&Planned> =
                singles.iter().filter(|p| p.asked.nats.map(|n| n as u32) == *level).collect();
            let small = of.iter().filter(|p| p.asked.small).count() as f64 / of.len() as f64;
            assert!((0.78..0.96).contains(&small), "{level:?}: {small}");
        }
    }

    #[test]
    fn names_salts_and_seeds_are_all_different_and_the_number_of_empties_varies() {
        let p = plan(300, 4, false);
        let names: std::collections::BTreeSet<_> = p.iter().map(|p| &p.name).collect();
        let salts: std::collections::BTreeSet<_> = p.iter().map(|p| &p.salt).collect();
        let seeds: std::collections::BTreeSet<_> = p.iter().map(|p| p.asked.seed).collect();
        assert!(names.len() == 300 && salts.len() == 300 && seeds.len() == 300);
        let empties: std::collections::BTreeSet<usize> = (0..8)
            .map(|s| plan(300, s, false).iter().filter(|p| p.asked.cell == Cell::Null).count())
            .collect();
        assert!(empties.len() > 3, "{empties:?}");
    }
}
