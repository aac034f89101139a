//! Morphology of sets of lattice nodes.

use super::grow::Lattice;
use crate::stats::SummedArea;

/// Steps of the flood fill, nodes: it crosses speckle holes, but not the gap between two objects.
const BRIDGE: usize = 2;
/// Bands without any measurement are crossed up to this many nodes: 18 px on a 640 px image.
const BAND: usize = 6;

impl Lattice {
    /// Nodes connected to `seeds` over `open` nodes.
    pub fn reached(&self, open: &[bool], seeds: &[usize]) -> Vec<bool> {
        let mut mask = vec![false; open.len()];
        self.flood(&mut mask, open, seeds);
        mask
    }

    /// Adds the nodes reached to `mask`.
    fn flood(&self, mask: &mut [bool], open: &[bool], seeds: &[usize]) {
        let mut queue: Vec<usize> = Vec::new();
        for &seed in seeds {
            if !mask[seed] && open[seed] {
                mask[seed] = true;
                queue.push(seed);
            }
        }
        while let Some(node) = queue.pop() {
            for neighbour in self.around(node, BRIDGE) {
                if !mask[neighbour] && open[neighbour] {
                    mask[neighbour] = true;
                    queue.push(neighbour);
                }
            }
        }
    }

    /// As [`Lattice::reached`], also across bands without a measurement.
    pub fn reached_across_bands(&self, open: &[bool], seeds: &[usize]) -> Vec<bool> {
        let mut mask = self.reached(open, seeds);
        loop {
            let beyond = self.across_bands(&mask, open);
            if beyond.is_empty() {
                return mask;
            }
            self.flood(&mut mask, open, &beyond);
        }
    }

    /// Open nodes opposite the set ones across unmeasured bands: rows or columns that the sensor lost.
    fn across_bands(&self, mask: &[bool], open: &[bool]) -> Vec<usize> {
        let inside = |c: isize, r: isize| {
            let node = r * self.columns as isize + c;
            let inside =
                (0..self.columns as isize).contains(&c) && (0..self.rows as isize).contains(&r);
            inside.then_some(node as usize)
        };
        let far_side = |node: usize, [dc, dr]: [isize; 2]| {
            let (c, r) = ((node % self.columns) as isize, (node / self.columns) as isize);
            let mut line = (1..=BAND as isize + 1).map_while(|k| inside(c + k * dc, r + k * dr));
            line.find(|&n| self.is_measured(n)).filter(|&n| open[n] && !mask[n])
        };
        let sides = [[1, 0], [-1, 0], [0, 1], [0, -1]];
        let set = (0..mask.len()).filter(|&node| mask[node]);
        set.flat_map(|node| sides.into_iter().filter_map(move |side| far_side(node, side)))
            .collect()
    }

    pub(super) fn around(&self, node: usize, radius: usize) -> impl Iterator<Item = usize> + '_ {
        let (c, r) = (node % self.columns, node / self.columns);
        let columns = c.saturating_sub(radius)..=(c + radius).min(self.columns - 1);
        let rows = r.saturating_sub(radius)..=(r + radius).min(self.rows - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| row * self.columns + column))
    }

    /// Nodes at most `steps` columns and `steps` rows from a set one.
    pub fn within(&self, mask: &[bool], steps: usize) -> Vec<bool> {
        let sums = SummedArea::of(self.columns, self.rows, |n| mask[n].then_some([1.0]));
        let around = |n: usize| sums.around(n % self.columns, n / self.columns, steps);
        (0..mask.len()).map(|n| around(n) > [0.0]).collect()
    }

    /// Nodes with a set node within one step.
    pub fn dilated(&self, mask: &[bool]) -> Vec<bool> {
        (0..mask.len()).map(|n| self.around(n, 1).any(|m| mask[m])).collect()
    }

    /// Closes gaps of up to two nodes that the set itself surrounds: where an edge meets the image's border
    /// at a slant, the outside of the image closes nothing.
    pub fn closed(&self, mask: &[bool]) -> Vec<bool> {
        // The image is padded by an unset node on every side.
        let (across, rows) = (self.columns + 2, self.rows + 2);
        let mut near = vec![false; across * rows];
        for node in (0..mask.len()).filter(|n| mask[*n]) {
            let (c, r) = (node % self.columns, node / self.columns);
            for row in r..=r + 2 {
                near[row * across + c..=row * across + c + 2].fill(true);
            }
        }
        let surrounded = |node: usize| {
            let (c, r) = (node % self.columns, node / self.columns);
            (r..=r + 2).all(|row| near[row * across + c..=row * across + c + 2].iter().all(|n| *n))
        };
        (0..mask.len()).map(surrounded).collect()
    }

    /// Nodes whose neighbours inside the image are all set.
    pub fn eroded(&self, mask: &[bool]) -> Vec<bool> {
        (0..mask.len()).map(|n| self.around(n, 1).all(|m| mask[m])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A board whose upper edge leaves the image at a slope of one in five.
    #[test]
    fn closing_adds_no_wedge_at_the_border() {
        let lattice = Lattice::bare(60, 20);
        let mask: Vec<bool> = (0..1200).map(|n| n % 60 < 20 + 5 * (n / 60)).collect();
        assert_eq!(lattice.closed(&mask), mask);
    }

    #[test]
    fn closing_fills_holes_and_keeps_a_full_image() {
        let lattice = Lattice::bare(12, 9);
        let mut mask = vec![true; 108];
        assert_eq!(lattice.closed(&mask), mask);
        mask[50] = false;
        mask[51] = false;
        assert!(lattice.closed(&mask).iter().all(|m| *m));
    }
}
