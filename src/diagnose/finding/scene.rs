//! The data that a layer's findings are measured on.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::diagnose::diagnosis::Size;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::samples::ViewData;
use crate::terms::{Statistic, Term};

/// The data a layer's findings are measured on.
pub struct Scene<'a> {
    pub statistic: Statistic,
    pub survey: &'a Survey,
    pub data: Vec<ViewData>,
    /// fx * baseline, px m.
    pub scale_px_m: f64,
    pub corner_px: f64,
}

impl Scene<'_> {
    /// Sum of the terms' values, without what the views' planes absorb.
    pub fn values(&self, terms: &[Term]) -> Vec<Vec<f64>> {
        self.levelled(|view| view.places.iter().map(|p| Term::sum(terms, p)).collect())
    }

    /// Responses without the terms, levelled in the same way.
    pub fn without(&self, terms: &[Term]) -> Vec<Vec<f64>> {
        self.levelled(|view| view.without(terms))
    }

    fn levelled(&self, of: impl Fn(&ViewData) -> Vec<f64> + Sync) -> Vec<Vec<f64>> {
        let levelled = |view: &ViewData| {
            let mut values = of(view);
            if self.statistic == Statistic::Bias {
                level(view, &mut values);
            }
            values
        };
        self.data.par_iter().map(levelled).collect()
    }
}

/// Subtracts the view's plane from `values`. The other nuisances would also absorb a part of a large effect.
fn level(view: &ViewData, values: &mut [f64]) {
    let Some(plane) = view.plane_of(values) else { return };
    for (p, y) in view.places.iter().zip(values) {
        *y -= plane.dot(&Vector3::new(1.0, p.x, p.y));
    }
}

/// Root mean square of a term's values over the recording.
pub fn size(scene: &Scene<'_>, values: &[Vec<f64>]) -> Size {
    let (mut mm, mut sigma, mut n) = (0.0, 0.0, 0.0);
    for (view, values) in scene.data.iter().zip(values) {
        for ((p, &f), &w) in view.places.iter().zip(values).zip(&view.weight) {
            if w <= 0.0 || !f.is_finite() {
                continue;
            }
            let px_mm = 1e3 * p.z * p.z / scene.scale_px_m;
            let (in_mm, in_sigma) = if scene.statistic == Statistic::Bias {
                (f * px_mm, f / p.variance.sqrt())
            } else {
                let factor = (0.5 * f).exp() - 1.0;
                (factor * p.variance.sqrt() * px_mm, factor)
            };
            mm += in_mm * in_mm;
            sigma += in_sigma * in_sigma;
            n += 1.0;
        }
    }
    let n = f64::max(n, 1.0);
    Size { mm: (mm / n).sqrt(), sigma: (sigma / n).sqrt() }
}
