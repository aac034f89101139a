//! Converts infrared amplitudes into the light of surfaces.

use std::sync::Arc;

use super::field::Field;
use super::surveyed_view::SurveyedView;
use crate::stats::median_in_place;
use crate::terms::PixelContext;

/// Conversion of infrared amplitudes into the light of surfaces.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    /// Median light of the recording, in the image's own units; 0 where there is no infrared.
    median: f64,
    ambient_share: f64,
}

impl Light {
    /// Light of a single pixel over the recording's median; 1 where unknown.
    pub fn of(&self, field: &Field, k: usize, p: &PixelContext) -> f64 {
        let Some(&light) = field.light.get(k) else { return 1.0 };
        let own = f64::from(light) / (1.0 + self.ambient_share * p.ambient * p.pattern_fall_off());
        if self.median > 0.0 && own.is_finite() { own / self.median } else { 1.0 }
    }
}

/// Removes the room's light and divides the views' light by the recording's median.
pub fn relative_light(views: &mut [SurveyedView]) -> Light {
    let share = ambient_share(views);
    let mut all: Vec<f32> = Vec::new();
    for p in views.iter_mut().flat_map(|v| Arc::make_mut(&mut v.places)) {
        p.light /= 1.0 + share * p.ambient * p.pattern_fall_off();
        if p.light.is_finite() {
            all.push(p.light as f32);
        }
    }
    let median = f64::from(median_in_place(&mut all));
    let usable = median > 0.0;
    for p in views.iter_mut().flat_map(|v| Arc::make_mut(&mut v.places)) {
        let light = p.light / median;
        p.light = if usable && light.is_finite() { light } else { 1.0 };
    }
    Light { median: if usable { median } else { 0.0 }, ambient_share: share }
}

/// Light of the room in the infrared image, per lux, relative to the pattern at 1 m. Amplitude times the
/// pattern's fall-off f is a (1 + share lux f), fitted as a line through the views' medians.
fn ambient_share(views: &[SurveyedView]) -> f64 {
    let points: Vec<(f64, f64)> = views
        .iter()
        .filter_map(|v| {
            let mut light: Vec<f32> = v.places.iter().map(|p| p.light as f32).collect();
            light.retain(|l| l.is_finite());
            let middle = v.places.get(v.places.len() / 2)?;
            let x = middle.ambient * middle.pattern_fall_off();
            let y = f64::from(median_in_place(&mut light));
            (x > 0.0 && y > 0.0).then_some((x, y))
        })
        .collect();
    if points.len() < 4 {
        return 0.0;
    }
    // Errors are proportional to the light.
    let n: f64 = points.iter().map(|p| p.1.powi(-2)).sum();
    let (x0, y0) = points.iter().fold((0.0, 0.0), |(x, y), p| {
        let w = p.1.powi(-2) / n;
        (x + w * p.0, y + w * p.1)
    });
    let (mut xx, mut xy) = (0.0, 0.0);
    for (x, y) in points {
        let w = y.powi(-2);
        xx += w * (x - x0).powi(2);
        xy += w * (x - x0) * (y - y0);
    }
    let slope = if xx > 0.0 { xy / xx } else { 0.0 };
    let level = y0 - slope * x0;
    if level > 0.0 { (slope / level).max(0.0) } else { 0.0 }
}
