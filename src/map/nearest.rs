//! Exact nearest neighbours: points in the cells of a grid, and a cache of the last search.
//!
//! Between two steps of ICP a point hardly moves. If its nearest neighbour was at distance `a` and
//! every other at `b` or more, it stays the nearest until the point has moved by (b - a) / 2: by the
//! triangle inequality the search can be skipped without an approximation.

use nalgebra::Vector3;

use super::icp::Target;
use super::index_map::within;
use super::point::Point;
use super::sparse_grid::{Cell, SparseGrid, cell_of};

#[derive(Debug, Clone)]
pub struct Nearest {
    points: Vec<Point>,
    grid: SparseGrid,
    /// The first point of each cell; most cells of a voxel grid's points hold one.
    heads: Vec<Entry>,
    /// The other points.
    rest: Vec<Entry>,
    side_m: f32,
    /// Largest distance of a neighbour, m.
    max_correspondence_m: f32,
}

/// A point as a search reads it.
#[derive(Debug, Clone, Copy)]
struct Entry {
    at: Vector3<f32>,
    point: u32,
    /// The next of the same cell in `rest`, [`NONE`] for the last.
    next: u32,
}

const NONE: u32 = u32::MAX;

/// Result of a search, kept for the next search of the same point.
#[derive(Debug, Clone, Copy)]
pub struct NeighbourCache {
    at: Vector3<f32>,
    /// Distance the point may move before a new search is needed, m; below 0 before the first search.
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

/// Extra reach of a search, as a share of the cell's side: with less, it is repeated sooner.
const MARGIN: f32 = 0.2;

impl Nearest {
    pub fn new(points: Vec<Point>, side_m: f32, max_correspondence_m: f32) -> Self {
        let mut grid = SparseGrid::with_room(points.len());
        let mut heads: Vec<Entry> = Vec::with_capacity(points.len());
        let mut rest = Vec::new();
        for (i, point) in points.iter().enumerate() {
            let cell = grid.insert(cell_of(&point.at, 1.0 / side_m));
            let mut entry = Entry { at: point.at, point: i as u32, next: NONE };
            match heads.get_mut(cell) {
                Some(head) => {
                    entry.next = std::mem::replace(&mut head.next, rest.len() as u32);
                    rest.push(entry);
                }
                None => heads.push(entry),
            }
        }
        Nearest { points, grid, heads, rest, side_m, max_correspondence_m }
    }

    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// Finds the nearest point, and how far the place may move until a new search is needed.
    fn search(&self, p: &Vector3<f32>, last: &NeighbourCache) -> NeighbourCache {
        let cell = cell_of(p, 1.0 / self.side_m);
        let known = match last.found {
            Some(i) => Some(self.points[i as usize].at),
            None => self.grid.get(cell).map(|cell| self.heads[cell].at),
        };
        let nearest = known.map_or(f32::INFINITY, |known| (known - p).norm());
        if nearest <= self.max_correspondence_m {
            self.search_within(p, nearest + MARGIN * self.side_m)
        } else {
            // A point that had no neighbour mostly still has none: search the whole reach at once.
            let none = last.found.is_none() && last.safe_radius >= 0.0;
            self.search_outwards(p, cell, if none { i32::MAX } else { 1 })
        }
    }

    /// Searches all cells within `reach`, m.
    fn search_within(&self, p: &Vector3<f32>, reach: f32) -> NeighbourCache {
        let mut search = Search::NOTHING;
        let corner = |sign: f32| cell_of(&p.map(|v| v + sign * reach), 1.0 / self.side_m);
        let (low, high) = (corner(-1.0), corner(1.0));
        self.grid.for_each_within(low, high, |cell| self.scan_cell(p, cell, &mut search));
        self.remember(p, &search, reach)
    }

    /// Searches growing boxes of cells, until no cell outside can hold a nearer point.
    fn search_outwards(&self, p: &Vector3<f32>, cell: Cell, begin: i32) -> NeighbourCache {
        // Distance from the point to the border of its own cell; each shell adds a side.
        let inside = (0..3)
            .map(|k| {
                let from = p[k] - cell[k] as f32 * self.side_m;
                from.min(self.side_m - from)
            })
            .fold(f32::INFINITY, f32::min)
            .max(0.0);
        // Enough shells for the largest distance.
        let last = (self.max_correspondence_m / self.side_m).ceil() as i32;
        let mut shell = begin.min(last);
        loop {
            let mut search = Search::NOTHING;
            let corner = |sign: i32| cell.map(|v| v + sign * shell);
            self.grid.for_each_within(corner(-1), corner(1), |c| self.scan_cell(p, c, &mut search));
            let seen = inside + shell as f32 * self.side_m;
            if shell == last || search.best.sqrt() <= seen {
                return self.remember(p, &search, seen);
            }
            shell = (2 * shell).min(last);
        }
    }

    /// Cache entry of a search that saw everything within `reach`, m.
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
        let mut entry = &self.heads[cell];
        loop {
            let distance = (entry.at - p).norm_squared();
            if distance < search.best {
                search.second = search.best;
                search.best = distance;
                search.nearest = Some(entry.point);
            } else if distance < search.second {
                search.second = distance;
            }
            match self.rest.get(entry.next as usize) {
                Some(next) => entry = next,
                None => return,
            }
        }
    }
}

impl Target for Nearest {
    type Cache = NeighbourCache;

    #[inline]
    fn find(&self, p: &Vector3<f32>, cache: &mut NeighbourCache) -> Option<&Point> {
        if (p - cache.at).norm() >= cache.safe_radius {
            *cache = self.search(p, cache);
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
        /// Compares with brute force, along a walk whose steps shrink as ICP's do.
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
