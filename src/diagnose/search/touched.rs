//! Columns of neighbouring samples, of which they touch a few.

/// Index and value of a sample's columns that may be nonzero.
pub type Entries = Vec<(usize, f64)>;

/// The columns that a block of samples touches.
pub struct TouchedColumns {
    /// Their indices, ascending.
    pub touched: Vec<usize>,
    /// Row-major, one row per sample.
    pub rows: Vec<f64>,
    /// Place of every column among those touched.
    place: Vec<usize>,
    entries: Entries,
}

impl TouchedColumns {
    /// Of so many columns in all, none yet.
    pub fn of(columns: usize) -> Self {
        let (touched, rows, entries) = (Vec::new(), Vec::new(), Vec::new());
        TouchedColumns { touched, rows, place: vec![usize::MAX; columns], entries }
    }

    /// Takes the columns of these samples, and forgets those before.
    pub fn fill(
        &mut self,
        samples: impl Iterator<Item = usize>,
        columns: impl Fn(usize, &mut Entries),
    ) {
        self.touched.drain(..).for_each(|j| self.place[j] = usize::MAX);
        self.entries.clear();
        let mut ends = Vec::new();
        for i in samples {
            columns(i, &mut self.entries);
            ends.push(self.entries.len());
        }
        for &(j, g) in &self.entries {
            if g != 0.0 && self.place[j] == usize::MAX {
                self.place[j] = 0;
                self.touched.push(j);
            }
        }
        self.touched.sort_unstable();
        self.touched.iter().enumerate().for_each(|(k, &j)| self.place[j] = k);
        let width = self.touched.len();
        self.rows.clear();
        self.rows.resize(ends.len() * width, 0.0);
        let mut first = 0;
        for (row, end) in self.rows.chunks_exact_mut(width.max(1)).zip(ends) {
            let mine = self.entries[first..end].iter().filter(|(_, g)| *g != 0.0);
            mine.for_each(|&(j, g)| row[self.place[j]] += g);
            first = end;
        }
    }
}
