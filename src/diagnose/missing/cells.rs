//! Share lost in each patch, and how much such shares scatter without a cause.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::odds::{Counting, odds};
use crate::camera::Camera;
use crate::diagnose::search::rows::Rows;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::margins::Margins;
use crate::diagnose::views::samples::in_patches;
use crate::diagnose::views::surveyed_view::SurveyedView;
use crate::diagnose::views::tiles::{SIDE, rim_px};
use crate::solve::plane_equations;
use crate::stats::at_least;
use crate::terms::PixelContext;

/// Pixel-frames of a patch, and how many of them have no measurement.
#[derive(Debug, Clone, Copy)]
pub struct Cell<'a> {
    pub place: &'a PixelContext,
    pub lost: f64,
    pub asked: f64,
    /// For the share that the view usually loses, and with its twin's variance.
    pub counting: Counting,
    /// Log odds of its twin's losses above those of no loss; 0 without a twin.
    pub expected: f64,
    /// Whether it is compared with a twin and it, a neighbour or one of their twins loses something.
    pub differs: bool,
}

impl Cell<'_> {
    /// Log odds of the share lost, as counted.
    pub fn odds(&self) -> f64 {
        odds(self.lost / self.asked)
    }
}

/// A patch of many tiles, with its own place.
#[derive(Debug, Clone, Copy, Default)]
pub struct Patch {
    pub place: PixelContext,
    pub lost: f64,
    pub asked: f64,
}

/// Converts the patches to cells. In each view so many readings are lost `together`.
pub fn cells<'a>(patches: &'a [Vec<Patch>], together: &[f64]) -> Vec<Vec<Cell<'a>>> {
    fn of_view(view: &[Patch], together: f64) -> Vec<Cell<'_>> {
        let usual = usual_share(view, together);
        let cell = |&Patch { ref place, lost, asked }| Cell {
            place,
            lost,
            asked,
            counting: Counting::of(usual, asked, together),
            expected: 0.0,
            differs: false,
        };
        view.iter().map(cell).collect()
    }
    patches.iter().zip(together).map(|(view, together)| of_view(view, *together)).collect()
}

/// Patches that lose more than chance brings this often are clumps.
const CHANCE: f64 = 1e-3;
/// Rounds that leave clumps out: from the share of all, first what is lost whole, then what is lost in part.
const ROUNDS: usize = 3;

/// Share that the patches lose, without clumps: from their median, weighted by the readings asked for, or from the
/// share of all where most lose nothing. The median alone is one of whole counts: off by a third where a patch
/// loses one or two.
pub fn usual_share(view: &[Patch], together: f64) -> f64 {
    let mut shares: Vec<[f64; 2]> = view.iter().map(|p| [p.lost / p.asked, p.asked]).collect();
    shares.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut left = 0.5 * shares.iter().map(|s| s[1]).sum::<f64>();
    let middle = shares.iter().find(|[_, asked]| {
        left -= asked;
        left <= 0.0
    });
    let share_of = |kept: &dyn Fn(&&Patch) -> bool| {
        let kept = view.iter().filter(kept);
        let [lost, asked] = kept.fold([0.0; 2], |s, p| [s[0] + p.lost, s[1] + p.asked]);
        (asked > 0.0).then(|| lost / asked)
    };
    let events = |readings: f64| (readings / together).round() as usize;
    let mut share = middle.map_or(0.0, |s| s[0]);
    if share == 0.0 {
        share = share_of(&|_| true).unwrap_or(0.0);
    }
    for _ in 0..ROUNDS {
        let chance = |p: &&Patch| at_least(events(p.lost), events(p.asked), share) > CHANCE;
        share = share_of(&chance).unwrap_or(share);
    }
    share
}

/// Cells across the picture: about a hundred a view, each wider than a clump of dead pixels.
const ACROSS: usize = 16;
/// Fewest tiles of a patch that is used.
const MIN_TILES: usize = 2;

/// Patches of all views, large enough to judge.
pub fn patches(survey: &Survey, camera: &Camera, margins: &Margins) -> Vec<Vec<Patch>> {
    let side = (camera.width.div_ceil(ACROSS * SIDE) * SIDE) as f64;
    let rim = rim_px(camera);
    let of_view = |view: &SurveyedView| {
        let apart = |i: usize| {
            let place = &view.places[i];
            margins.hold(place).then_some(place.edge < rim)
        };
        let of_group = |group: Vec<usize>| {
            let sum = |of: &dyn Fn(usize) -> f64| group.iter().map(|&i| of(i)).sum::<f64>();
            let asked = sum(&|i| view.tiles[i].asked);
            let lost = sum(&|i| view.tiles[i].asked * view.tiles[i].missing);
            let mut place = view.places[group[0]];
            place.average(&view.places, &|of| sum(&|i| view.tiles[i].asked * of(i)) / asked);
            place.side = side;
            Patch { place, lost, asked }
        };
        let mut groups = in_patches(&view.places, side, apart);
        groups.retain(|group| group.len() >= MIN_TILES);
        groups.into_iter().map(of_group).collect()
    };
    survey.views.iter().map(of_view).collect()
}

/// Row, column and rim flag of a cell.
fn key(cell: &Cell<'_>, rim: f64) -> (u32, u32, bool) {
    let at = |x: f64| (x / cell.place.side) as u32;
    (at(cell.place.v), at(cell.place.u), cell.place.edge < rim)
}

/// Sets what is expected of the cells by the losses at the same places of their twins. Drops cells without a
/// twin.
pub fn set_expected(cells: &mut [Vec<Cell<'_>>], twins: &[Vec<Cell<'_>>], rim: f64) {
    for (mine, theirs) in cells.iter_mut().zip(twins) {
        let theirs: BTreeMap<_, _> = theirs
            .iter()
            .map(|c| (key(c, rim), (c.odds() - c.counting.bias - odds(0.0), c)))
            .collect();
        let mut loses = Vec::new();
        mine.retain_mut(|c| {
            let Some((expected, twin)) = theirs.get(&key(c, rim)) else { return false };
            c.expected = *expected;
            c.counting.variance += twin.counting.variance;
            loses.push(twin.lost > 0.0 || c.lost > 0.0);
            true
        });
        // A clump seen in one run could have lain next to it in the other.
        let differs: Vec<bool> = (0..mine.len())
            .map(|i| (0..mine.len()).any(|j| loses[j] && touch(&mine[i], &mine[j])))
            .collect();
        mine.iter_mut().zip(differs).for_each(|(c, differs)| c.differs = differs);
    }
}

/// Every tile as a cell, to locate and size losses, not to detect them.
pub fn fine<'a>(survey: &'a Survey, margins: &Margins) -> Vec<Vec<Cell<'a>>> {
    let of_view = |v: &'a SurveyedView| {
        let held = v.patches().filter(|(place, _)| margins.hold(place));
        held.map(|(place, t)| {
            let (lost, asked) = (t.asked * t.missing, t.asked);
            let counting = Counting::default();
            Cell { place, lost, asked, counting, expected: 0.0, differs: false }
        })
        .collect()
    };
    survey.views.iter().map(of_view).collect()
}

/// Variances of the log odds without a cause.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Of a view's level.
    pub level: f64,
    /// Of a view's slope across the picture, per unit of normalised coordinate.
    pub slope: f64,
    /// Of a cell, beyond counting.
    pub cell: f64,
    /// Of a cell compared with a twin where either, or a neighbour, loses something. Clumps lie elsewhere in
    /// every run, and where neither loses anything there is no scatter.
    pub differing: f64,
    /// Number of neighbouring cells that share a clump and so count as one.
    pub clump: f64,
}

/// Scatter before anything is measured: views differ by a factor of e, and so do the sides of a picture.
pub const USUAL: Scatter =
    Scatter { level: 1.0, slope: 4.0, cell: 0.5, differing: 0.5, clump: 4.0 };
/// Lower bound on an estimated scatter.
pub const MIN_SCATTER: Scatter =
    Scatter { level: 0.1, slope: 0.4, cell: 0.1, differing: 0.1, clump: 1.0 };
/// A scatter estimated from n views is enlarged by 1 + `FEW` / n.
pub const FEW: f64 = 4.0;
/// Cells closer than this many sides are neighbours, including diagonal ones.
const APART: f64 = 1.5;

impl Scatter {
    /// A view's log odds, weighted, with its level and slopes as nuisances.
    pub fn rows(&self, cells: &[Cell<'_>], left: &[f64]) -> Option<Rows<'static>> {
        let of = |c: &Cell<'_>| if c.differs { self.differing } else { self.cell };
        let variance = |c: &Cell<'_>| self.clump * of(c) + c.counting.variance;
        let weights: Vec<f64> = cells.iter().map(|c| variance(c).recip()).collect();
        let plane: Vec<f64> = cells.iter().flat_map(|c| [1.0, c.place.x, c.place.y]).collect();
        let precision = [self.level, self.slope, self.slope].map(f64::recip);
        Rows::new(left, weights, &plane, precision.len(), &precision)
    }

    /// Scatter of the log odds `left`, at least `min`: the views' levels and slopes by least squares, then
    /// the cells about them.
    pub fn of(views: &[Vec<Cell>], left: &[Vec<f64>], min: Scatter) -> Self {
        let (mut sums, mut n) = ([0.0; 4], [0.0; 4]);
        let mut neighbours = Neighbours::default();
        for (cells, left) in views.iter().zip(left).filter(|(cells, _)| !cells.is_empty()) {
            let points = cells.iter().zip(left).map(|(c, y)| ([c.place.x, c.place.y], *y, 1.0));
            let (mut a, b) = plane_equations(points);
            // The slopes are held as by one cell.
            a += Matrix3::from_diagonal(&Vector3::new(0.0, 1.0, 1.0));
            let own = a.lu().solve(&b).unwrap_or_default();
            sums[0] += (left.iter().sum::<f64>() / left.len().max(1) as f64).powi(2);
            sums[1] += own.y.powi(2) + own.z.powi(2);
            let plane = |c: &Cell| own.x + own.y * c.place.x + own.z * c.place.y;
            let off: Vec<f64> = cells.iter().zip(left).map(|(c, y)| y - plane(c)).collect();
            for (cell, y) in cells.iter().zip(&off) {
                let kind = 2 + usize::from(cell.differs);
                sums[kind] += y * y - cell.counting.variance;
                n[kind] += 1.0;
            }
            neighbours.add(cells, &off);
            (n[0], n[1]) = (n[0] + 1.0, n[1] + 2.0);
        }
        let mean = |k: usize| sums[k] / f64::max(n[k], 1.0);
        let few = 1.0 + FEW / f64::max(n[0], 1.0);
        Scatter {
            level: (few * mean(0)).max(min.level),
            slope: (few * mean(1)).max(min.slope),
            cell: mean(2).max(min.cell),
            differing: mean(3).max(min.differing),
            // Cells that count as one.
            clump: (1.0 + neighbours.more()).max(min.clump),
        }
    }
}

/// Whether two cells are neighbours, or the rim and the rest of one patch.
fn touch(a: &Cell, b: &Cell) -> bool {
    let side = a.place.side.max(b.place.side).max(1.0);
    (a.place.u - b.place.u).hypot(a.place.v - b.place.v) < APART * side
}

/// How strongly neighbouring cells correlate.
#[derive(Default)]
pub struct Neighbours {
    product: f64,
    pub square: f64,
    pairs: f64,
    cells: f64,
}

impl Neighbours {
    /// Adds every pair of touching cells once, including a patch's rim and its other part.
    fn add(&mut self, cells: &[Cell], off: &[f64]) {
        for (i, (a, x)) in cells.iter().zip(off).enumerate() {
            self.square += x * x;
            self.cells += 1.0;
            for (b, y) in cells[i + 1..].iter().zip(&off[i + 1..]) {
                if touch(a, b) {
                    self.product += x * y;
                    self.pairs += 1.0;
                }
            }
        }
    }

    /// Same for many cells, by column and row.
    pub fn add_grid(&mut self, off: &BTreeMap<(i64, i64), f64>) {
        for ((u, v), x) in off {
            self.square += x * x;
            self.cells += 1.0;
            for at in [(u + 1, *v), (*u, v + 1), (u + 1, v + 1), (u - 1, v + 1)] {
                if let Some(y) = off.get(&at) {
                    self.product += x * y;
                    self.pairs += 1.0;
                }
            }
        }
    }

    /// Number of further cells that a cell is one with, of its eight neighbours.
    pub fn more(&self) -> f64 {
        let rho = self.product / self.pairs.max(1.0) * self.cells / self.square.max(1e-12);
        8.0 * rho.clamp(0.0, 1.0)
    }
}
