//! Cubes of space with a number each: a hash table of bricks, 4 x 4 x 4 cubes that lie together in
//! memory, for who asks for one cube asks for its neighbours next.

/// Integer coordinates of a cube.
pub type Place = [i32; 3];

/// From cubes to indices 0, 1, 2, ... in order of arrival.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Index of a brick + 1; zero is free.
    slots: Vec<u32>,
    bricks: Vec<Brick>,
    places: Vec<Place>,
}

#[derive(Debug, Clone)]
struct Brick {
    place: Place,
    /// A bit a cube, x fastest.
    occupied: u64,
    index: [u32; 64],
}

/// Half full at most: probes stay short.
const MIN_SLOTS: usize = 1 << 10;

impl Default for Cells {
    fn default() -> Self {
        Cells { slots: vec![0; MIN_SLOTS], bricks: Vec::new(), places: Vec::new() }
    }
}

impl Cells {
    /// With room for `n` cubes.
    pub fn with_room(n: usize) -> Self {
        Cells { places: Vec::with_capacity(n), ..Cells::default() }
    }

    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// The cube of an index.
    pub fn place(&self, index: usize) -> Place {
        self.places[index]
    }

    /// The index of a cube, where it has one.
    #[inline]
    pub fn get(&self, place: Place) -> Option<usize> {
        let brick = &self.bricks[self.brick(place.map(|v| v >> 2))?];
        let bit = bit(place);
        (brick.occupied >> bit & 1 == 1).then(|| brick.index[bit] as usize)
    }

    /// The index of a cube, a new one if it had none.
    #[inline]
    pub fn add(&mut self, place: Place) -> usize {
        let at = place.map(|v| v >> 2);
        let brick = match self.brick(at) {
            Some(found) => found,
            None => self.add_brick(at),
        };
        let (brick, bit) = (&mut self.bricks[brick], bit(place));
        if brick.occupied >> bit & 1 == 0 {
            brick.occupied |= 1 << bit;
            brick.index[bit] = self.places.len() as u32;
            self.places.push(place);
        }
        brick.index[bit] as usize
    }

    /// The indices of all cubes in a box, both corners included.
    #[inline]
    pub fn each_within(&self, low: Place, high: Place, mut told: impl FnMut(usize)) {
        let [x, y, z] = [0, 1, 2].map(|k| low[k] >> 2..=high[k] >> 2);
        for z in z {
            for y in y.clone() {
                for x in x.clone() {
                    let Some(found) = self.brick([x, y, z]) else { continue };
                    let brick = &self.bricks[found];
                    let mut left = brick.occupied & inside([x, y, z], low, high);
                    while left != 0 {
                        told(brick.index[left.trailing_zeros() as usize] as usize);
                        left &= left - 1;
                    }
                }
            }
        }
    }

    #[inline]
    fn brick(&self, at: Place) -> Option<usize> {
        let mask = self.slots.len() - 1;
        let mut slot = hash(at) & mask;
        loop {
            match self.slots[slot] {
                0 => return None,
                found if self.bricks[found as usize - 1].place == at => {
                    return Some(found as usize - 1);
                }
                _ => slot = (slot + 1) & mask,
            }
        }
    }

    #[cold]
    fn add_brick(&mut self, place: Place) -> usize {
        self.bricks.push(Brick { place, occupied: 0, index: [0; 64] });
        if 2 * self.bricks.len() > self.slots.len() {
            self.slots = vec![0; 2 * self.slots.len()];
            for i in 0..self.bricks.len() {
                self.enter(i);
            }
        } else {
            self.enter(self.bricks.len() - 1);
        }
        self.bricks.len() - 1
    }

    fn enter(&mut self, brick: usize) {
        let mask = self.slots.len() - 1;
        let mut slot = hash(self.bricks[brick].place) & mask;
        while self.slots[slot] != 0 {
            slot = (slot + 1) & mask;
        }
        self.slots[slot] = brick as u32 + 1;
    }
}

/// A cube's bit in its brick.
#[inline]
fn bit([x, y, z]: Place) -> usize {
    ((x & 3) | (y & 3) << 2 | (z & 3) << 4) as usize
}

/// The bits of a brick's cubes that are in a box which it touches.
#[inline]
fn inside(brick: Place, low: Place, high: Place) -> u64 {
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

/// Primes of Teschner et al. 2003, mixed once more: neighbours must not lie in a row of slots.
#[inline]
fn hash([x, y, z]: Place) -> usize {
    let mixed = (x as u32).wrapping_mul(73_856_093)
        ^ (y as u32).wrapping_mul(19_349_663)
        ^ (z as u32).wrapping_mul(83_492_791);
    (mixed.wrapping_mul(0x9E37_79B1) >> 7) as usize
}

/// The cube of side 1 / `per_metre` that holds a point.
#[inline]
pub fn place_of(at: &nalgebra::Vector3<f32>, per_metre: f32) -> Place {
    // floor() is a call into the C library on plain x86-64, and a checked cast is four
    // instructions a number. The sum with 1.5 * 2^23 has a step of 1: its last bits are the whole
    // number, up to 2^22; a place beyond, or NaN, is some place.
    const WHOLE: f32 = 12_582_912.0;
    [at.x, at.y, at.z]
        .map(|v| (v * per_metre - 0.5 + WHOLE).to_bits() as i32 - WHOLE.to_bits() as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    #[test]
    fn it_is_a_map() {
        let (mut cells, mut oracle) = (Cells::default(), HashMap::new());
        for k in 0..40_000i32 {
            let place = [k % 61 - 30, (k / 7) % 53 - 26, (k * k) % 97 - 48];
            let next = oracle.len();
            let expected = *oracle.entry(place).or_insert(next);
            assert_eq!(cells.add(place), expected);
        }
        assert_eq!(cells.len(), oracle.len());
        for (place, index) in &oracle {
            assert_eq!(cells.get(*place), Some(*index));
            assert_eq!(cells.place(*index), *place);
        }
        assert_eq!(cells.get([1000, 0, 0]), None);
        for k in 0..300i32 {
            let low = [k % 41 - 30, k % 37 - 20, k % 29 - 20];
            let high = [low[0] + k % 7, low[1] + k % 3, low[2] + k % 10];
            let mut found = Vec::new();
            cells.each_within(low, high, |i| found.push(i));
            found.sort_unstable();
            let within = |p: &Place| (0..3).all(|k| (low[k]..=high[k]).contains(&p[k]));
            let mut all: Vec<usize> =
                oracle.iter().filter(|(p, _)| within(p)).map(|(_, &i)| i).collect();
            all.sort_unstable();
            assert_eq!(found, all, "{low:?} {high:?}");
        }
    }
}
