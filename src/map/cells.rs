//! Cubes of space with a number each: an open hash table from places to indices.

/// Integer coordinates of a cube.
pub type Place = [i32; 3];

/// From cubes to indices 0, 1, 2, ... in order of arrival.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Index + 1; zero is free.
    slots: Vec<u32>,
    places: Vec<Place>,
}

/// Half full at most: probes stay short.
const LEAST_SLOTS: usize = 1 << 12;

impl Default for Cells {
    fn default() -> Self {
        Cells { slots: vec![0; LEAST_SLOTS], places: Vec::new() }
    }
}

impl Cells {
    /// With room for `n` cubes.
    pub fn with_room(n: usize) -> Self {
        let slots = (2 * n).next_power_of_two().max(LEAST_SLOTS);
        Cells { slots: vec![0; slots], places: Vec::with_capacity(n) }
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
        let mask = self.slots.len() - 1;
        let mut slot = hash(place) & mask;
        loop {
            match self.slots[slot] {
                0 => return None,
                found if self.places[found as usize - 1] == place => {
                    return Some(found as usize - 1);
                }
                _ => slot = (slot + 1) & mask,
            }
        }
    }

    /// The index of a cube, a new one if it had none.
    #[inline]
    pub fn add(&mut self, place: Place) -> usize {
        let mask = self.slots.len() - 1;
        let mut slot = hash(place) & mask;
        loop {
            match self.slots[slot] {
                0 => break,
                found if self.places[found as usize - 1] == place => return found as usize - 1,
                _ => slot = (slot + 1) & mask,
            }
        }
        self.places.push(place);
        self.slots[slot] = self.places.len() as u32;
        if 2 * self.places.len() > self.slots.len() {
            self.grow();
        }
        self.places.len() - 1
    }

    fn grow(&mut self) {
        let mask = 2 * self.slots.len() - 1;
        let mut slots = vec![0; mask + 1];
        for (index, &place) in self.places.iter().enumerate() {
            let mut slot = hash(place) & mask;
            while slots[slot] != 0 {
                slot = (slot + 1) & mask;
            }
            slots[slot] = index as u32 + 1;
        }
        self.slots = slots;
    }
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
    // floor() is a call into the C library on plain x86-64; a cast and a comparison are not.
    [at.x, at.y, at.z].map(|v| {
        let scaled = v * per_metre;
        let towards_zero = scaled as i32;
        towards_zero - i32::from((towards_zero as f32) > scaled)
    })
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
    }
}
