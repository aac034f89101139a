//! Number of readings that are lost together.

use std::collections::BTreeMap;

use rayon::prelude::*;

use super::cells::{Cell, Neighbours};
use super::points::part;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::tiles::SIDE;
use crate::stats::range;

/// Number of a pixel's readings that are lost together, view by view: one where each frame fails by itself, all
/// where the pixel is dead. The variance of the pixels' losses within a tile over that of single losses.
pub fn frames_together(fields: &[Field]) -> Vec<f64> {
    let of_view = |field: &Field| {
        let frames = field.frames.len() as f64;
        let down = field.height.div_ceil(SIDE);
        let mut tiles = vec![[0.0; 3]; field.width.div_ceil(SIDE) * down];
        for (&i, &measured) in field.pixels.iter().zip(&field.measured) {
            let (u, v) = (i as usize % field.width, i as usize / field.width);
            let lost = frames - f64::from(measured);
            let sum = &mut tiles[u / SIDE * down + v / SIDE];
            *sum = [sum[0] + 1.0, sum[1] + lost, sum[2] + lost * lost];
        }
        let spread = |&[n, lost, squares]: &[f64; 3]| {
            let share = lost / (n * frames);
            [squares - lost * lost / n, (n - 1.0) * frames * share * (1.0 - share)]
        };
        let [seen, single] = tiles
            .iter()
            .filter(|t| t[0] > 0.0)
            .map(spread)
            .fold([0.0; 2], |s, t| [s[0] + t[0], s[1] + t[1]]);
        if single > 0.0 { (seen / single).clamp(1.0, frames) } else { 1.0 }
    };
    fields.par_iter().map(of_view).collect()
}

/// Parts of a view's reach along an axis.
pub const PARTS: usize = 64;

/// Index of the part of the view's reach that each cell lies in.
pub fn parts(cells: &[Cell<'_>], at: &dyn Fn(&Cell<'_>) -> f64) -> Vec<usize> {
    let span = range(cells.iter().map(at));
    cells.iter().map(|c| part(at(c), span, PARTS)).collect()
}

/// Number of pixel-frames that are lost together: the overdispersion of the patches' losses about a share
/// that grows with `along` within each view, times the number of patches that are alike.
pub fn clump(views: &[Vec<Cell<'_>>], along: &dyn Fn(&Cell<'_>) -> f64) -> f64 {
    let (mut neighbours, mut expected) = (Neighbours::default(), 0.0);
    for view in views.iter().filter(|v| v.iter().any(|c| c.lost > 0.0)) {
        let mut off = BTreeMap::new();
        for (c, share) in view.iter().zip(growing_share(view, along)) {
            let side = c.place.side.max(1.0);
            let at = ((c.place.u / side) as i64, (c.place.v / side) as i64);
            off.insert(at, c.lost - share * c.asked);
            expected += share * (1.0 - share) * c.asked;
        }
        neighbours.add_grid(&off);
    }
    let together = (neighbours.square / f64::max(expected, f64::MIN_POSITIVE)).max(1.0);
    // Where losses are single, neighbours are alike only in what the share misses.
    together * (1.0 + neighbours.more() * (1.0 - 1.0 / together))
}

/// Share lost in each cell: the non-decreasing least-squares fit along the axis (pool adjacent violators,
/// Ayer et al. 1955).
fn growing_share(view: &[Cell<'_>], along: &dyn Fn(&Cell<'_>) -> f64) -> Vec<f64> {
    let parts = parts(view, along);
    let mut sums = [[0.0; 2]; PARTS];
    for (c, part) in view.iter().zip(&parts) {
        sums[*part] = [sums[*part][0] + c.lost, sums[*part][1] + c.asked];
    }
    let share = |[lost, asked]: [f64; 2]| if asked > 0.0 { lost / asked } else { 0.0 };
    let mut pools: Vec<([f64; 2], usize)> = Vec::new();
    for sum in sums {
        pools.push((sum, 1));
        while let [.., (before, _), (last, _)] = pools[..]
            && (before[1] == 0.0 || last[1] == 0.0 || share(before) > share(last))
            && let Some((sum, count)) = pools.pop()
            && let Some(pool) = pools.last_mut()
        {
            *pool = ([pool.0[0] + sum[0], pool.0[1] + sum[1]], pool.1 + count);
        }
    }
    let grown: Vec<f64> =
        pools.into_iter().flat_map(|(sum, n)| std::iter::repeat_n(share(sum), n)).collect();
    parts.into_iter().map(|part| grown[part]).collect()
}

#[cfg(test)]
mod tests {
    use rand::Rng;

    use super::*;
    use crate::diagnose::missing::cells::{Patch, cells};
    use crate::rng::Seed;
    use crate::terms::PixelContext;

    const ACROSS: usize = 40;
    const FRAMES: usize = 4;

    /// Patches of a picture in which each reading is lost with a `chance`, and all of a `dead` pixel's.
    fn view(chance: impl Fn(f64) -> f64, dead: impl Fn(usize, usize) -> bool) -> Vec<Patch> {
        let mut rng = Seed(3).stream("clumps");
        let mut patches = Vec::new();
        for (row, column) in (0..ACROSS).flat_map(|r| (0..ACROSS).map(move |c| (r, c))) {
            let mut lost = 0;
            for (v, u) in (0..SIDE).flat_map(|v| (0..SIDE).map(move |u| (v, u))) {
                let (u, v) = (column * SIDE + u, row * SIDE + v);
                let chance = if dead(u, v) { 1.0 } else { chance(u as f64) };
                lost += (0..FRAMES).filter(|_| rng.random_bool(chance)).count();
            }
            let middle = |k: usize| (k * SIDE) as f64 + 2.0;
            let (u, v, side) = (middle(column), middle(row), SIDE as f64);
            let place = PixelContext { u, v, side, ..Default::default() };
            patches.push(Patch { place, lost: lost as f64, asked: (SIDE * SIDE * FRAMES) as f64 });
        }
        patches
    }

    /// Losses that follow the axis are single, a dead pixel is lost in all frames, and a hole is one event.
    #[test]
    fn single_losses_are_single_however_they_rise_along_the_axis() {
        let along = |sign: f64, view: &[Patch]| {
            clump(&cells(&[view.to_vec()], &[1.0]), &|c: &Cell<'_>| sign * c.place.u)
        };
        let even = along(1.0, &view(|_| 0.01, |_, _| false));
        let rising = view(|u| 0.3 * (-u / 10.0).exp(), |_, _| false);
        let pixels = along(1.0, &view(|_| 0.0, |u, v| (7 * u + 11 * v).is_multiple_of(97)));
        let hole = |from: usize| {
            let inside = move |u: usize| (from..from + 20).contains(&u);
            along(1.0, &view(|_| 0.0, move |u, v| inside(u) && inside(v)))
        };
        let [with, against] = [-1.0, 1.0].map(|sign| along(sign, &rising));
        let all = (400 * FRAMES) as f64;
        let holes = [hole(60), hole(140)].map(|size| all / size);
        println!("{even:.2} {with:.2} {against:.1} {pixels:.2} {holes:.1?}");
        assert!((1.0..1.3).contains(&even) && (1.0..1.3).contains(&with), "{even} {with}");
        assert!(against > 5.0, "{against}");
        assert!((3.0..6.0).contains(&pixels), "{pixels}");
        assert!(holes.iter().all(|events| *events < 6.0), "{holes:?}");
    }

    /// A law over the picture does not pass for dead pixels.
    #[test]
    fn dead_pixels_lose_all_frames_and_failed_matches_one() {
        let mut rng = Seed(4).stream("frames together");
        let mut field = |chance: &dyn Fn(usize) -> f64, dead: f64| {
            let (width, height) = (160, 120);
            let measured = (0..width * height).map(|i| {
                let frames = 0..FRAMES as u16;
                if rng.random_bool(dead) {
                    return 0;
                }
                frames.filter(|_| !rng.random_bool(chance(i % width))).count() as u16
            });
            let measured = measured.collect();
            let pixels = (0..(width * height) as u32).collect();
            let frames = vec![(0.0, 0.0); FRAMES];
            Field { width, height, pixels, measured, frames, ..Field::default() }
        };
        let fields = [
            field(&|_| 0.02, 0.0),
            field(&|u| 0.5 * (u as f64 / 160.0).powi(4), 0.0),
            field(&|_| 0.0, 0.02),
            field(&|_| 0.0, 0.0),
        ];
        let [single, law, dead, none] = frames_together(&fields)[..] else { panic!("four") };
        assert!((1.0..1.1).contains(&single) && (1.0..1.1).contains(&law), "{single} {law}");
        assert!(dead > 0.95 * FRAMES as f64, "{dead}");
        assert_eq!(none, 1.0);
    }
}
