//! Sets of lattice nodes: reached, grown, shrunk.

use super::grow::Lattice;

/// Gaps up to this many nodes are crossed: speckle holes, not the gap between two objects.
const BRIDGE: usize = 2;

impl Lattice {
    /// Nodes reached from `seeds` over `open` nodes.
    pub fn reached(&self, open: &[bool], seeds: &[usize]) -> Vec<bool> {
        let mut mask = vec![false; open.len()];
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
        mask
    }

    pub(super) fn around(&self, node: usize, radius: usize) -> impl Iterator<Item = usize> + '_ {
        let (c, r) = (node % self.columns, node / self.columns);
        let columns = c.saturating_sub(radius)..=(c + radius).min(self.columns - 1);
        let rows = r.saturating_sub(radius)..=(r + radius).min(self.rows - 1);
        rows.flat_map(move |row| columns.clone().map(move |column| row * self.columns + column))
    }

    /// Nodes at most `steps` columns and `steps` rows from a set one.
    pub fn within(&self, mask: &[bool], steps: usize) -> Vec<bool> {
        let spread = |mask: &[bool], length: usize, at: &dyn Fn(usize, usize) -> usize| {
            let mut wide = vec![false; mask.len()];
            for line in 0..mask.len() / length {
                let (mut forth, mut back) = (usize::MAX, usize::MAX);
                for k in 0..length {
                    let (a, b) = (at(line, k), at(line, length - 1 - k));
                    forth = if mask[a] { 0 } else { forth.saturating_add(1) };
                    back = if mask[b] { 0 } else { back.saturating_add(1) };
                    wide[a] |= forth <= steps;
                    wide[b] |= back <= steps;
                }
            }
            wide
        };
        let columns = self.columns;
        let along_rows = spread(mask, columns, &|row, k| row * columns + k);
        spread(&along_rows, self.rows, &|column, k| k * columns + column)
    }

    /// Every node with a set node within one step.
    pub fn dilated(&self, mask: &[bool]) -> Vec<bool> {
        (0..mask.len()).map(|n| self.around(n, 1).any(|m| mask[m])).collect()
    }

    /// Every node whose neighbours inside the image are all set.
    pub fn eroded(&self, mask: &[bool]) -> Vec<bool> {
        (0..mask.len()).map(|n| self.around(n, 1).all(|m| mask[m])).collect()
    }
}
