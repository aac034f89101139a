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

    /// Shell by shell of cubes, until no cube that is left can hold a nearer point.
    fn search(&self, p: &Vector3<f32>) -> Memory {
        let mut search = Search { nearest: None, best: f32::INFINITY, second: f32::INFINITY };
        let place = place_of(p, 1.0 / self.side_m);
        // From the point to the border of its own cube; a shell more is a side more.
        let inside = (0..3)
            .map(|k| {
                let from = p[k] - place[k] as f32 * self.side_m;
                from.min(self.side_m - from)
            })
            .fold(f32::INFINITY, f32::min)
            .max(0.0);
        let mut shell = 0;
        let reach = loop {
            self.scan(p, place, shell, &mut search);
            // Everything nearer than this has been seen.
            let seen = inside + shell as f32 * self.side_m;
            if search.best.sqrt() <= seen && shell > 0 || seen > self.gate_m {
                break seen;
            }
            shell += 1;
        };
        let nearest = search.best.sqrt();
        let found = search.nearest.filter(|_| nearest <= self.gate_m);
        let others = search.second.sqrt().min(reach);
        let leeway = match found {
            Some(_) => 0.5 * (others - nearest),
            None => nearest.min(reach) - self.gate_m,
        };
        Memory { at: *p, leeway, found }
    }

    fn scan(&self, p: &Vector3<f32>, [x, y, z]: Place, shell: i32, search: &mut Search) {
        for dz in -shell..=shell {
            for dy in -shell..=shell {
                let rim = dz.abs() == shell || dy.abs() == shell;
                // Inside the rim only the two ends of the row belong to the shell.
                let step = if rim { 1 } else { 2 * shell.max(1) };
                let mut dx = -shell;
                while dx <= shell {
                    if let Some(cell) = self.cells.get([x + dx, y + dy, z + dz]) {
                        self.scan_cell(p, cell, search);
                    }
                    dx += step;
                }
            }
        }
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
            *memory = self.search(p);
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
