//! The nearest neighbour, exactly: points in cubes, and what is known from the last time.
//!
//! Between two steps of ICP a point hardly moves. If its nearest neighbour was at distance `a` and
//! every other at `b` or more, it stays the nearest until the point has moved by (b - a) / 2: the
//! triangle inequality saves the search without an approximation.

use nalgebra::Vector3;

use super::cells::{Cells, Place, place_of};
use super::icp::Target;
use super::point::Point;

/// Points, found by place.
#[derive(Debug, Clone)]
pub struct Nearest {
    points: Vec<Point>,
    cells: Cells,
    /// The points of cube `i` are `order[begins[i]..begins[i + 1]]`.
    begins: Vec<u32>,
    order: Vec<u32>,
    side_m: f32,
    /// Neighbours farther than this do not count, m.
    gate_m: f32,
}

/// What a search left behind.
#[derive(Debug, Clone, Copy)]
pub struct Memory {
    at: Vector3<f32>,
    /// How far the point may move before it must be searched for again, m.
    leeway: f32,
    found: Option<u32>,
}

impl Default for Memory {
    fn default() -> Self {
        Memory { at: Vector3::zeros(), leeway: -1.0, found: None }
    }
}

struct Search {
    nearest: Option<u32>,
    /// Squared distances of the nearest and of the second.
    best: f32,
    second: f32,
}

impl Default for Search {
    fn default() -> Self {
        Search { nearest: None, best: f32::INFINITY, second: f32::INFINITY }
    }
}

/// A search looks this share of a cube's side farther than it must: more is slower now, less is
/// sooner repeated.
const MARGIN: f32 = 0.2;

impl Nearest {
    pub fn new(points: Vec<Point>, side_m: f32, gate_m: f32) -> Self {
        let mut cells = Cells::with_room(points.len());
        let cell_of: Vec<usize> =
            points.iter().map(|p| cells.add(place_of(&p.at, 1.0 / side_m))).collect();
        let mut begins = vec![0u32; cells.len() + 1];
        for &cell in &cell_of {
            begins[cell + 1] += 1;
        }
        for i in 0..cells.len() {
            begins[i + 1] += begins[i];
        }
        let mut next = begins.clone();
        let mut order = vec![0; points.len()];
        for (i, &cell) in cell_of.iter().enumerate() {
            order[next[cell] as usize] = i as u32;
            next[cell] += 1;
        }
        Nearest { points, cells, begins, order, side_m, gate_m }
    }

    pub fn points(&self) -> &[Point] {
        &self.points
    }

    /// All cubes as near as a point that is known, and a little farther: for the leeway.
    fn search(&self, p: &Vector3<f32>, known: Option<u32>) -> Memory {
        let place = place_of(p, 1.0 / self.side_m);
        let known = known.or_else(|| self.first_in(place));
        let Some(known) = known else { return self.search_outwards(p, place) };
        let least = (self.points[known as usize].at - p).norm();
        if least > self.gate_m {
            return self.search_outwards(p, place);
        }
        let reach = least + MARGIN * self.side_m;
        let mut search = Search::default();
        let corner = |sign: f32| place_of(&p.map(|v| v + sign * reach), 1.0 / self.side_m);
        let (low, high) = (corner(-1.0), corner(1.0));
        self.cells.each_within(low, high, |cell| self.scan_cell(p, cell, &mut search));
        self.remember(p, &search, reach)
    }

    fn first_in(&self, place: Place) -> Option<u32> {
        let cell = self.cells.get(place)?;
        self.order.get(self.begins[cell] as usize).copied()
    }

    /// Box after larger box of cubes, until none that is left can hold a nearer point.
    fn search_outwards(&self, p: &Vector3<f32>, place: Place) -> Memory {
        // From the point to the border of its own cube; a shell more is a side more.
        let inside = (0..3)
            .map(|k| {
                let from = p[k] - place[k] as f32 * self.side_m;
                from.min(self.side_m - from)
            })
            .fold(f32::INFINITY, f32::min)
            .max(0.0);
        let mut shell = 1;
        loop {
            let mut search = Search::default();
            let corner = |sign: i32| place.map(|v| v + sign * shell);
            self.cells.each_within(corner(-1), corner(1), |c| self.scan_cell(p, c, &mut search));
            let seen = inside + shell as f32 * self.side_m;
            if search.best.sqrt() <= seen || seen > self.gate_m {
                return self.remember(p, &search, seen);
            }
            shell += 1;
        }
    }

    /// What a search that saw everything within `reach`, m, leaves behind.
    fn remember(&self, p: &Vector3<f32>, search: &Search, reach: f32) -> Memory {
        let nearest = search.best.sqrt();
        let found = search.nearest.filter(|_| nearest <= self.gate_m);
        let others = search.second.sqrt().min(reach);
        let leeway = match found {
            Some(_) => 0.5 * (others - nearest),
            None => nearest.min(reach) - self.gate_m,
        };
        Memory { at: *p, leeway, found }
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
    type Memory = Memory;

    #[inline]
    fn find(&self, p: &Vector3<f32>, memory: &mut Memory) -> Option<&Point> {
        if (p - memory.at).norm() >= memory.leeway {
            *memory = self.search(p, memory.found);
        }
        let point = &self.points[memory.found? as usize];
        ((point.at - p).norm_squared() <= self.gate_m * self.gate_m).then_some(point)
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
            axial: 1.0,
            across: 1.0,
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
            let mut memory = Memory::default();
            for k in 0..12 {
                let p = Vector3::from(start) + Vector3::from(step) * 0.6f32.powi(k);
                let told = target.find(&p, &mut memory).map(|q| (q.at - p).norm());
                let least = places
                    .iter()
                    .map(|&q| (Vector3::from(q) - p).norm())
                    .fold(f32::INFINITY, f32::min);
                match told {
                    Some(distance) => prop_assert!((distance - least).abs() < 1e-6),
                    None => prop_assert!(least > 0.1 - 1e-6),
                }
            }
        }
    }
}
