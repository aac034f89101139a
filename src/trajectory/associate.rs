//! Which stamp of one list belongs to which of another: TUM's associate.py.

/// Indices into the two lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pair {
    pub first: usize,
    pub second: usize,
}

/// Pairs of stamps closer than `limit`, s: the nearest pair first, each stamp once, in the order of
/// the first list. Both lists in time order.
///
/// ```
/// use kinoise::trajectory::{associate, Pair};
/// let pairs = associate(&[0.0, 0.1], &[0.011, 0.089, 0.09], 0.02);
/// assert_eq!(pairs, [Pair { first: 0, second: 0 }, Pair { first: 1, second: 2 }]);
/// ```
pub fn associate(first: &[f64], second: &[f64], limit: f64) -> Vec<Pair> {
    let mut near: Vec<(f64, Pair)> = Vec::new();
    let mut begin = 0;
    for (i, &a) in first.iter().enumerate() {
        // Inclusive here; what the subtraction below makes of the edges decides.
        while begin < second.len() && second[begin] < a - limit {
            begin += 1;
        }
        let within = second[begin..].iter().take_while(|&&b| b <= a + limit).count();
        for (k, &b) in second[begin..begin + within].iter().enumerate() {
            let apart = (a - b).abs();
            if apart < limit {
                near.push((apart, Pair { first: i, second: begin + k }));
            }
        }
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (mut used, mut taken) = (vec![false; first.len()], vec![false; second.len()]);
    let mut pairs: Vec<Pair> = near
        .into_iter()
        .filter_map(|(_, pair)| {
            let free = !used[pair.first] && !taken[pair.second];
            used[pair.first] |= free;
            taken[pair.second] |= free;
            free.then_some(pair)
        })
        .collect();
    pairs.sort();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The script's own double loop.
    fn by_the_book(first: &[f64], second: &[f64], limit: f64) -> Vec<Pair> {
        let mut all = Vec::new();
        for (i, a) in first.iter().enumerate() {
            for (j, b) in second.iter().enumerate() {
                if (a - b).abs() < limit {
                    all.push(((a - b).abs(), Pair { first: i, second: j }));
                }
            }
        }
        all.sort_by(|a, b| a.partial_cmp(b).unwrap());
        let mut pairs: Vec<Pair> = Vec::new();
        for (_, p) in all {
            if pairs.iter().all(|q| q.first != p.first && q.second != p.second) {
                pairs.push(p);
            }
        }
        pairs.sort();
        pairs
    }

    proptest! {
        #[test]
        fn as_the_script_does(
            mut a in prop::collection::vec(0.0f64..1.0, 0..40),
            mut b in prop::collection::vec(0.0f64..1.0, 0..40),
            limit in 0.0f64..0.2,
        ) {
            a.sort_by(f64::total_cmp);
            b.sort_by(f64::total_cmp);
            prop_assert_eq!(associate(&a, &b, limit), by_the_book(&a, &b, limit));
        }
    }
}
