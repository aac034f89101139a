//! The axis along which a term is shown: where it matters, and its curve.

use super::scene::Scene;
use crate::diagnose::diagnosis::Curve;
use crate::stats::range;
use crate::terms::{Axis, Basis, Coordinate, PixelContext, Statistic};

type OfPlace = Box<dyn Fn(&PixelContext) -> f64>;

/// The axis along which a term is shown.
pub struct Along {
    label: &'static str,
    /// Of its interval.
    pub unit: &'static str,
    value: OfPlace,
}

impl Along {
    pub fn of(scene: &Scene<'_>, basis: &Basis) -> Self {
        let axis = basis.axis();
        let corner = scene.corner_px;
        let is_ambient = matches!(basis, Basis::Log1p { over: Coordinate::Ambient(_) });
        let over = if let Basis::Curve { over, .. } = basis { Some(*over) } else { None };
        let (label, value): (&'static str, OfPlace) = match axis {
            Axis::Z => ("depth, m", Box::new(|p| p.z)),
            Axis::DisparityPhase => {
                let period = basis.period().unwrap_or(1.0);
                let phase = move |p: &PixelContext| (p.disparity / period).rem_euclid(1.0);
                ("fraction of a pixel of disparity", Box::new(phase))
            }
            Axis::Column => ("column, px", Box::new(|p| p.u)),
            Axis::Row => ("row, px", Box::new(|p| p.v)),
            Axis::Radius | Axis::Pixel => {
                ("distance from the image centre, px", Box::new(move |p| p.radius * corner))
            }
            Axis::Theta => ("tilt, rad", Box::new(|p| p.theta)),
            Axis::Azimuth if over == Some(Coordinate::Along) => {
                let along = |p: &PixelContext| Coordinate::Along.value(p);
                ("from the optical axis along the tilt, ray", Box::new(along))
            }
            Axis::Azimuth => ("direction of the tilt, rad", Box::new(|p| p.azimuth)),
            Axis::TargetPosition if over == Some(Coordinate::Down) => {
                ("down on the board, m", Box::new(|p| p.down))
            }
            Axis::TargetPosition => ("right on the board, m", Box::new(|p| p.right)),
            Axis::EdgeDistance => ("distance from the target's edge, px", Box::new(|p| p.edge)),
            Axis::Intensity if is_ambient => (
                "ambient light over the sensor's own",
                Box::new(|p| Coordinate::Ambient(1.0).value(p)),
            ),
            Axis::Intensity => {
                ("infrared light of the surface, of the median", Box::new(|p| p.light))
            }
            Axis::SessionTime => ("time since the first view, s", Box::new(|p| p.session_s)),
            Axis::Temperature => ("temperature, degrees Celsius", Box::new(|p| p.temperature_c)),
            _ => ("", Box::new(|p| p.z)),
        };
        Along { label, unit: if is_ambient { "1" } else { axis.unit() }, value }
    }

    /// Interval that holds the middle nine tenths of the term's energy.
    pub fn interval(&self, scene: &Scene<'_>, values: &[Vec<f64>]) -> [f64; 2] {
        let mut energy: Vec<(f64, f64)> = Vec::new();
        for (view, values) in scene.data.iter().zip(values) {
            for ((p, f), w) in view.places.iter().zip(values).zip(&view.weight) {
                let e = w * f * f;
                if e.is_finite() && e > 0.0 {
                    energy.push(((self.value)(p), e));
                }
            }
        }
        energy.sort_by(|a, b| a.0.total_cmp(&b.0));
        let total: f64 = energy.iter().map(|e| e.1).sum();
        let at = |share: f64| {
            let mut sum = 0.0;
            let found = energy.iter().find(|e| {
                sum += e.1;
                sum >= share * total
            });
            found.or(energy.last()).map_or(0.0, |e| e.0)
        };
        [at(0.05), at(0.95)]
    }

    /// Binned curve: as measured without the other terms, and as fitted.
    pub fn curve(&self, scene: &Scene<'_>, left: &[Vec<f64>], mine: &[Vec<f64>]) -> Curve {
        const BINS: usize = 32;
        let [low, high] =
            range(scene.data.iter().flat_map(|v| v.places.iter().map(|p| (self.value)(p))));
        let bin = |p: &PixelContext| {
            let place = ((self.value)(p) - low) / (high - low).max(1e-12) * BINS as f64;
            (place as usize).min(BINS - 1)
        };
        let mut by_view = vec![[[0.0f64; 4]; BINS]; scene.data.len()];
        for (v, view) in scene.data.iter().enumerate() {
            for (i, p) in view.places.iter().enumerate() {
                let w = view.weight[i];
                if w > 0.0 {
                    let s = &mut by_view[v][bin(p)];
                    s[0] += w;
                    s[1] += w * left[v][i];
                    s[2] += w * mine[v][i];
                    s[3] += w * (self.value)(p);
                }
            }
        }
        let of_mean = scene.statistic == Statistic::Bias;
        let y_label = if of_mean { "disparity error, px" } else { "noise over the model's" };
        let (x_label, y_label) = (self.label.into(), y_label.into());
        let mut curve = Curve { x_label, y_label, ..Curve::default() };
        let show = |y: f64| if of_mean { y } else { (0.5 * y).exp() };
        for b in 0..BINS {
            let total: f64 = by_view.iter().map(|s| s[b][0]).sum();
            if total <= 0.0 {
                continue;
            }
            let mean = by_view.iter().map(|s| s[b][1]).sum::<f64>() / total;
            let model = by_view.iter().map(|s| s[b][2]).sum::<f64>() / total;
            let scatter: f64 = by_view.iter().map(|s| (s[b][1] - s[b][0] * mean).powi(2)).sum();
            let error = scatter.sqrt() / total;
            curve.x.push(by_view.iter().map(|s| s[b][3]).sum::<f64>() / total);
            curve.y.push(show(mean));
            curve.y_std_error.push(if of_mean { error } else { 0.5 * error * show(mean) });
            curve.model.push(show(model));
        }
        curve
    }
}
