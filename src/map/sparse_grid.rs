//! Cubic cells of space with a number each: a hash table of bricks, 4 x 4 x 4 cells that lie together
//! in memory, for who asks for one cell asks for its neighbours next.

use std::collections::HashMap;

use nalgebra::Vector3;
use rustc_hash::FxBuildHasher;

pub type Cell = [i32; 3];

/// From cells to indices 0, 1, 2, ... in order of arrival.
#[derive(Debug, Clone, Default)]
pub struct SparseGrid {
    /// Index of a brick by a quarter of its cells' coordinates.
    brick_of: HashMap<Cell, u32, FxBuildHasher>,
    bricks: Vec<Brick>,
    cells: Vec<Cell>,
}

#[derive(Debug, Clone)]
struct Brick {
    /// A bit a cell, x fastest.
    occupied: u64,
    index: [u32; 64],
}

impl SparseGrid {
    pub fn with_room(n: usize) -> Self {
        SparseGrid { cells: Vec::with_capacity(n), ..Default::default() }
    }

    pub fn len(&self) -> usize {
        self.cells.len()
    }

    pub fn cell(&self, index: usize) -> Cell {
        self.cells[index]
    }

    #[inline]
    pub fn get(&self, cell: Cell) -> Option<usize> {
        let brick = self.brick(cell.map(|v| v >> 2))?;
        let bit = bit(cell);
        (brick.occupied >> bit & 1 == 1).then(|| brick.index[bit] as usize)
    }

    /// The index of a cell, a new one if it had none.
    #[inline]
    pub fn insert(&mut self, cell: Cell) -> usize {
        let brick = *self.brick_of.entry(cell.map(|v| v >> 2)).or_insert_with(|| {
            self.bricks.push(Brick { occupied: 0, index: [0; 64] });
            self.bricks.len() as u32 - 1
        });
        let (brick, bit) = (&mut self.bricks[brick as usize], bit(cell));
        if brick.occupied >> bit & 1 == 0 {
            brick.occupied |= 1 << bit;
            brick.index[bit] = self.cells.len() as u32;
            self.cells.push(cell);
        }
        brick.index[bit] as usize
    }

    /// Visit the indices of all cells in a box, both corners included.
    #[inline]
    pub fn for_each_within(&self, low: Cell, high: Cell, mut visit: impl FnMut(usize)) {
        let [x, y, z] = [0, 1, 2].map(|k| low[k] >> 2..=high[k] >> 2);
        for z in z {
            for y in y.clone() {
                for x in x.clone() {
                    let Some(brick) = self.brick([x, y, z]) else { continue };
                    let mut left = brick.occupied & inside([x, y, z], low, high);
                    while left != 0 {
                        visit(brick.index[left.trailing_zeros() as usize] as usize);
                        left &= left - 1;
                    }
                }
            }
        }
    }

    #[inline]
    fn brick(&self, at: Cell) -> Option<&Brick> {
        self.brick_of.get(&at).map(|&i| &self.bricks[i as usize])
    }
}

/// A cell's bit in its brick.
#[inline]
fn bit([x, y, z]: Cell) -> usize {
    ((x & 3) | (y & 3) << 2 | (z & 3) << 4) as usize
}

/// The bits of a brick's cells that are in a box which it touches.
#[inline]
fn inside(brick: Cell, low: Cell, high: Cell) -> u64 {
    // Along each axis: from 0 to 3 inside the brick.
    let bits = |k: usize, wide: u32| -> u64 {
        let first = (low[k] - 4 * brick[k]).max(0) as u32;
        let last = (high[k] - 4 * brick[k]).min(3) as u32;
        let below = |n: u32| 1u64.checked_shl(n * wide).unwrap_or(0).wrapping_sub(1);
        below(last + 1) & !below(first)
    };
    let x = (bits(0, 1) & 0xF) * 0x1111_1111_1111_1111;
    let y = (bits(1, 4) & 0xFFFF) * 0x0001_0001_0001_0001;
    x & y & bits(2, 16)
}

/// The cell of side 1 / `per_metre` that holds a point.
#[inline]
pub fn cell_of(at: &Vector3<f32>, per_metre: f32) -> Cell {
    // floor() is a call into the C library on plain x86-64, and a checked cast is four
    // instructions a number. The sum with 1.5 * 2^23 has a step of 1: its last bits are the whole
    // number, up to 2^22; a cell beyond, or NaN, is some cell.
    const WHOLE: f32 = 12_582_912.0;
    [at.x, at.y, at.z]
        .map(|v| (v * per_metre - 0.5 + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_a_map() {
        let (mut grid, mut oracle) = (SparseGrid::default(), HashMap::new());
        for k in 0..40_000i32 {
            let cell = [k % 61 - 30, (k / 7) % 53 - 26, (k * k) % 97 - 48];
            let next = oracle.len();
            let expected = *oracle.entry(cell).or_insert(next);
            assert_eq!(grid.insert(cell), expected);
        }
        assert_eq!(grid.len(), oracle.len());
        for (cell, index) in &oracle {
            assert_eq!(grid.get(*cell), Some(*index));
            assert_eq!(grid.cell(*index), *cell);
        }
        assert_eq!(grid.get([1000, 0, 0]), None);
        for k in 0..300i32 {
            let low = [k % 41 - 30, k % 37 - 20, k % 29 - 20];
            let high = [low[0] + k % 7, low[1] + k % 3, low[2] + k % 10];
            let mut found = Vec::new();
            grid.for_each_within(low, high, |i| found.push(i));
            found.sort_unstable();
            let within = |p: &Cell| (0..3).all(|k| (low[k]..=high[k]).contains(&p[k]));
            let mut all: Vec<usize> =
                oracle.iter().filter(|(p, _)| within(p)).map(|(_, &i)| i).collect();
            all.sort_unstable();
            assert_eq!(found, all, "{low:?} {high:?}");
        }
    }
}
