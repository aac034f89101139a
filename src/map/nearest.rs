//! The nearest neighbour, exactly: points in the cells of a grid, and what is known from the last time.
//!
//! Between two steps of ICP a point hardly moves. If its nearest neighbour was at distance `a` and
//! every other at `b` or more, it stays the nearest until the point has moved by (b - a) / 2: the
//! triangle inequality saves the search without an approximation.

use nalgebra::Vector3;

use super::icp::Target;
use super::index_map::within;
use super::point::Point;
use super::sparse_grid::{Cell, SparseGrid, cell_of};

#[derive(Debug, Clone)]
pub struct Nearest {
    points: Vec<Point>,
    grid: SparseGrid,
    /// The points of cell `i` are `order[begins[i]..begins[i + 1]]`.
    begins: Vec<u32>,
    order: Vec<u32>,
    side_m: f32,
    /// Neighbours farther than this do not count, m.
    max_correspondence_m: f32,
}

/// What a search leaves behind for the next search of the same point.
#[derive(Debug, Clone, Copy)]
pub struct NeighbourCache {
    at: Vector3<f32>,
    /// How far the point may move before it must be searched for again, m.
    safe_radius: f32,
    found: Option<u32>,
}

impl Default for NeighbourCache {
    fn default() -> Self {
        NeighbourCache { at: Vector3::zeros(), safe_radius: -1.0, found: None }
    }
}

struct Search {
    nearest: Option<u32>,
    /// Squared distances of the nearest and of the second.
    best: f32,
    second: f32,
}

impl Search {
    const NOTHING: Self = Search { nearest: None, best: f32::INFINITY, second: f32::INFINITY };
}

/// Of a cell's side, how much farther a search looks than it must: less is sooner repeated.
const MARGIN: f32 = 0.2;

impl Nearest {
    pub fn new(points: Vec<Point>, side_m: f32, max_correspondence_m: f32) -> Self {
        let mut grid = SparseGrid::with_room(points.len());
        let cells: Vec<usize> =
            points.iter().map(|p| grid.insert(cell_of(&p.at, 1.0 / side_m))).collect();
        let mut begins = vec![0u32; grid.len() + 1];
        for &cell in &cells {
            begins[cell + 1] += 1;
        }
        for i in 0..grid.len() {
            begins[i + 1] += begins[i];
        }
        let mut next = begins.clone();
        let mut order = vec![0; points.len()];
        for (i, &cell) in cells.iter().enumerate() {
            order[next[cell] as usize] = i as u32;
            next[cell] += 1;
        }
        Nearest { points, grid, begins, order, side_m, max_correspondence_m }
    }

    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// All cells as near as a point that is known, and a little farther: for the safe radius.
    fn search(&self, p: &Vector3<f32>, known: Option<u32>) -> NeighbourCache {
        let cell = cell_of(p, 1.0 / self.side_m);
        let first = |cell| self.order.get(self.begins[cell] as usize).copied();
        let known = known.or_else(|| self.grid.get(cell).and_then(first));
        let Some(known) = known else { return self.search_outwards(p, cell) };
        let nearest = (self.points[known as usize].at - p).norm();
        if nearest > self.max_correspondence_m {
            return self.search_outwards(p, cell);
        }
        let reach = nearest + MARGIN * self.side_m;
        let mut search = Search::NOTHING;
        let corner = |sign: f32| cell_of(&p.map(|v| v + sign * reach), 1.0 / self.side_m);
        let (low, high) = (corner(-1.0), corner(1.0));
        self.grid.for_each_within(low, high, |cell| self.scan_cell(p, cell, &mut search));
        self.remember(p, &search, reach)
    }

    /// Box after larger box of cells, until none that is left can hold a nearer point.
    fn search_outwards(&self, p: &Vector3<f32>, cell: Cell) -> NeighbourCache {
        // From the point to the border of its own cell; a shell more is a side more.
        let inside = (0..3)
            .map(|k| {
                let from = p[k] - cell[k] as f32 * self.side_m;
                from.min(self.side_m - from)
            })
            .fold(f32::INFINITY, f32::min)
            .max(0.0);
        let mut shell = 1;
        loop {
            let mut search = Search::NOTHING;
            let corner = |sign: i32| cell.map(|v| v + sign * shell);
            self.grid.for_each_within(corner(-1), corner(1), |c| self.scan_cell(p, c, &mut search));
            let seen = inside + shell as f32 * self.side_m;
            if search.best.sqrt() <= seen || seen > self.max_correspondence_m {
                return self.remember(p, &search, seen);
            }
            shell += 1;
        }
    }

    /// What a search that saw everything within `reach`, m, leaves behind.
    fn remember(&self, p: &Vector3<f32>, search: &Search, reach: f32) -> NeighbourCache {
        let nearest = search.best.sqrt();
        let found = search.nearest.filter(|_| nearest <= self.max_correspondence_m);
        let others = search.second.sqrt().min(reach);
        let safe_radius = match found {
            Some(_) => 0.5 * (others - nearest),
            None => nearest.min(reach) - self.max_correspondence_m,
        };
        NeighbourCache { at: *p, safe_radius, found }
    }

    #[inline]
    fn scan_cell(&self, p: &Vector3<f32>, cell: usize, search: &mut Search) {
        for &i in &self.order[self.begins[cell] as usize..self.begins[cell + 1] as usize] {
            let distance = (self.points[i as usize].at - p).norm_squared();
            if distance < search.best {
                search.second = search.best;
                search.best = distance;
                search.nearest = Some(i);
            } else if distance < search.second {
                search.second = distance;
            }
        }
    }
}

impl Target for Nearest {
    type Cache = NeighbourCache;

    #[inline]
    fn find(&self, p: &Vector3<f32>, cache: &mut NeighbourCache) -> Option<&Point> {
        if (p - cache.at).norm() >= cache.safe_radius {
            *cache = self.search(p, cache.found);
        }
        within(&self.points[cache.found? as usize], p, self.max_correspondence_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cloud(places: &[[f32; 3]]) -> Vec<Point> {
        let point = |&p: &[f32; 3]| Point {
            at: Vector3::from(p),
            normal: Vector3::z(),
            sigma_axial: 1.0,
            sigma_normal: 1.0,
            pixel: 0,
        };
        places.iter().map(point).collect()
    }

    proptest! {
        /// Against looking at every point, along a walk whose steps shrink as ICP's do.
        #[test]
        fn as_looking_at_every_point(
            places in prop::collection::vec(prop::array::uniform3(-0.4f32..0.4), 0..120),
            start in prop::array::uniform3(-0.5f32..0.5),
            step in prop::array::uniform3(-0.05f32..0.05),
        ) {
            let target = Nearest::new(cloud(&places), 0.03, 0.1);
            let mut cache = NeighbourCache::default();
            for k in 0..12 {
                let p = Vector3::from(start) + Vector3::from(step) * 0.6f32.powi(k);
                let found = target.find(&p, &mut cache).map(|q| (q.at - p).norm());
                let nearest = places
                    .iter()
                    .map(|&q| (Vector3::from(q) - p).norm())
                    .fold(f32::INFINITY, f32::min);
                match found {
                    Some(distance) => prop_assert!((distance - nearest).abs() < 1e-6),
                    None => prop_assert!(nearest > 0.1 - 1e-6),
                }
            }
        }
    }
}
