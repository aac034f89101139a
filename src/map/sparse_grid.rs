//! Maps cubic cells of space to indices: a hash table of bricks of 4 x 4 x 4 cells that lie together in
//! memory, because look-ups of a cell are followed by look-ups of its neighbours.

use nalgebra::Vector3;

pub type Cell = [i32; 3];

/// A map from cells to indices 0, 1, 2, ... in order of insertion.
#[derive(Debug, Clone)]
pub struct SparseGrid {
    /// The first brick of each slot or [`NONE`]; their number is a power of two.
    slots: Vec<u32>,
    bricks: Vec<Brick>,
    /// The brick last written to; the next cell is mostly in it, too.
    recent: u32,
    cells: Vec<Cell>,
}

#[derive(Debug, Clone)]
struct Brick {
    /// The cells' coordinates divided by four.
    at: Cell,
    /// The next brick of the same slot.
    next: u32,
    /// One bit per cell, x fastest.
    occupied: u64,
    index: [u32; 64],
}

const NONE: u32 = u32::MAX;
/// Initial slots. A room of 4 m has 32^3 bricks of 3 cm cells, of which surfaces fill a tenth.
const SLOTS: usize = 1 << 12;

impl Default for SparseGrid {
    fn default() -> Self {
        SparseGrid { slots: vec![NONE; SLOTS], bricks: Vec::new(), recent: NONE, cells: Vec::new() }
    }
}

impl SparseGrid {
    pub fn with_room(n: usize) -> Self {
        SparseGrid { cells: Vec::with_capacity(n), ..Default::default() }
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

    /// The index of a cell, newly assigned if it had none.
    #[inline]
    pub fn insert(&mut self, cell: Cell) -> usize {
        let brick = self.brick_to_write(cell.map(|v| v >> 2));
        let (brick, bit) = (&mut self.bricks[brick as usize], bit(cell));
        if brick.occupied >> bit & 1 == 0 {
            brick.occupied |= 1 << bit;
            brick.index[bit] = self.cells.len() as u32;
            self.cells.push(cell);
        }
        brick.index[bit] as usize
    }

    /// Visits the indices of all cells in a box, both corners included.
    #[inline]
    pub fn for_each_within(&self, low: Cell, high: Cell, mut visit: impl FnMut(usize)) {
        self.for_each_cell_within(low, high, |index, _| visit(index));
    }

    /// As [`SparseGrid::for_each_within`], with the cells.
    #[inline]
    pub fn for_each_cell_within(&self, low: Cell, high: Cell, mut visit: impl FnMut(usize, Cell)) {
        let [x, y, z] = [0, 1, 2].map(|k| low[k] >> 2..=high[k] >> 2);
        for z in z {
            for y in y.clone() {
                for x in x.clone() {
                    let Some(brick) = self.brick([x, y, z]) else { continue };
                    let mut left = brick.occupied & inside([x, y, z], low, high);
                    while left != 0 {
                        let bit = left.trailing_zeros() as i32;
                        let within = [bit & 3, bit >> 2 & 3, bit >> 4];
                        let cell = [4 * x + within[0], 4 * y + within[1], 4 * z + within[2]];
                        visit(brick.index[bit as usize] as usize, cell);
                        left &= left - 1;
                    }
                }
            }
        }
    }

    #[inline]
    fn brick(&self, at: Cell) -> Option<&Brick> {
        let mut i = self.slots[self.slot(at)];
        while i != NONE {
            let brick = &self.bricks[i as usize];
            if brick.at == at {
                return Some(brick);
            }
            i = brick.next;
        }
        None
    }

    #[inline]
    fn brick_to_write(&mut self, at: Cell) -> u32 {
        if self.bricks.get(self.recent as usize).is_none_or(|brick| brick.at != at) {
            let mut i = self.slots[self.slot(at)];
            while i != NONE && self.bricks[i as usize].at != at {
                i = self.bricks[i as usize].next;
            }
            self.recent = if i == NONE { self.new_brick(at) } else { i };
        }
        self.recent
    }

    fn new_brick(&mut self, at: Cell) -> u32 {
        let i = self.bricks.len() as u32;
        self.bricks.push(Brick { at, next: NONE, occupied: 0, index: [0; 64] });
        if self.bricks.len() <= self.slots.len() {
            self.link(i);
        } else {
            self.slots = vec![NONE; 2 * self.slots.len()];
            (0..self.bricks.len() as u32).for_each(|i| self.link(i));
        }
        i
    }

    fn link(&mut self, i: u32) {
        let slot = self.slot(self.bricks[i as usize].at);
        self.bricks[i as usize].next = std::mem::replace(&mut self.slots[slot], i);
    }

    /// Adjacent bricks are in adjacent slots, and no two of a box of 5 x 5 x 5 share one.
    #[inline]
    fn slot(&self, [x, y, z]: Cell) -> usize {
        let place = x.wrapping_add(y.wrapping_mul(19)).wrapping_add(z.wrapping_mul(367));
        place as usize & (self.slots.len() - 1)
    }
}

/// Bit number of a cell in its brick.
#[inline]
fn bit([x, y, z]: Cell) -> usize {
    ((x & 3) | (y & 3) << 2 | (z & 3) << 4) as usize
}

/// Bit mask of a brick's cells that lie in a box which it overlaps.
#[inline]
fn inside(brick: Cell, low: Cell, high: Cell) -> u64 {
    // Range along each axis, 0 to 3 inside the brick.
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

/// The cell of side 1 / `per_metre` that contains a point.
#[inline]
pub fn cell_of(at: &Vector3<f32>, per_metre: f32) -> Cell {
    [at.x, at.y, at.z].map(|v| cell_along(v, per_metre))
}

/// One coordinate of [`cell_of`].
#[inline]
pub fn cell_along(v: f32, per_metre: f32) -> i32 {
    // floor() is a call into the C library on plain x86-64, and a checked cast takes four
    // instructions. Near 1.5 * 2^23 an `f32` has a step of 1, so the low bits of the sum are the
    // integer, up to 2^22. Coordinates beyond, and NaN, give an arbitrary cell.
    const WHOLE: f32 = 12_582_912.0;
    ((v * per_metre - 0.5 + WHOLE).to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn it_is_a_map() {
        let (mut grid, mut oracle) = (SparseGrid::default(), HashMap::new());
        for k in 0..40_000i32 {
            let cell = [k % 61 - 30, (k / 7) % 53 - 26, (k * k) % 97 - 48];
            let next = oracle.len();
            let expected = *oracle.entry(cell).or_insert(next);
            assert_eq!(grid.insert(cell), expected);
        }
        assert_eq!(grid.cells.len(), oracle.len());
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
