//! Colours that keep their order in print without colour.

use plotters::style::RGBColor;

pub(super) const INK: RGBColor = RGBColor(33, 33, 33);
pub(super) const FAINT: RGBColor = RGBColor(110, 110, 110);
pub(super) const GRID: RGBColor = RGBColor(225, 225, 225);

/// Viridis (van der Walt and Smith 2015) up to the green that still shows on white.
const DISTANCES: [RGBColor; 6] = [
    RGBColor(68, 1, 84),
    RGBColor(65, 68, 135),
    RGBColor(42, 120, 142),
    RGBColor(34, 168, 132),
    RGBColor(122, 209, 81),
    RGBColor(190, 214, 40),
];

/// ColorBrewer's YlGnBu up to the blue on which black still shows.
const SURFACE: [RGBColor; 6] = [
    RGBColor(255, 255, 217),
    RGBColor(237, 248, 177),
    RGBColor(199, 233, 180),
    RGBColor(127, 205, 187),
    RGBColor(65, 182, 196),
    RGBColor(29, 145, 192),
];

/// ColorBrewer's RdBu, reversed: blue nearer than the plane, red farther.
const RESIDUALS: [RGBColor; 5] = [
    RGBColor(5, 74, 150),
    RGBColor(103, 169, 214),
    RGBColor(255, 255, 255),
    RGBColor(239, 138, 98),
    RGBColor(165, 15, 33),
];

/// Of a distance: dark is near. `share` runs from 0 to 1, as in the others.
pub(super) fn distance(share: f64) -> RGBColor {
    between(&DISTANCES, share)
}

/// Of a sigma on the map: light is small.
pub(super) fn surface(share: f64) -> RGBColor {
    between(&SURFACE, share)
}

/// Of a residual: white is zero, at 0.5.
pub(super) fn residual(share: f64) -> RGBColor {
    between(&RESIDUALS, share)
}

fn between(anchors: &[RGBColor], share: f64) -> RGBColor {
    let last = anchors.len() - 1;
    let at = share.clamp(0.0, 1.0) * last as f64;
    let i = (at as usize).min(last - 1);
    let [RGBColor(r0, g0, b0), RGBColor(r1, g1, b1)] = [anchors[i], anchors[i + 1]];
    let mix =
        |a: u8, b: u8| (f64::from(a) + (at - i as f64) * (f64::from(b) - f64::from(a))).round();
    RGBColor(mix(r0, r1) as u8, mix(g0, g1) as u8, mix(b0, b1) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luma(RGBColor(r, g, b): RGBColor) -> f64 {
        0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
    }

    #[test]
    fn luminance_is_ordered() {
        for i in 0..20 {
            let [a, b] = [f64::from(i) / 20.0, f64::from(i + 1) / 20.0];
            assert!(luma(distance(a)) < luma(distance(b)));
            assert!(luma(surface(a)) > luma(surface(b)));
            assert!(luma(residual(0.5 * a)) < luma(residual(0.5 * b)));
            assert!(luma(residual(0.5 + 0.5 * a)) > luma(residual(0.5 + 0.5 * b)));
        }
    }
}
