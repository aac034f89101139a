//! Colours that keep their order when printed in greyscale.

use plotters::style::RGBColor;

pub(super) const INK: RGBColor = RGBColor(33, 33, 33);
pub(super) const FAINT: RGBColor = RGBColor(110, 110, 110);
pub(super) const GRID: RGBColor = RGBColor(225, 225, 225);
/// The pages' accent colour.
pub(super) const ACCENT: RGBColor = RGBColor(0x1d, 0x91, 0xc0);

/// Distances, dark is near: viridis (van der Walt and Smith 2015) up to the green that still shows on white.
pub(super) const DISTANCES: [u32; 6] = [0x440154, 0x414487, 0x2a788e, 0x22a884, 0x7ad151, 0xbed628];
/// Sigma on the map, light is small: ColorBrewer's YlGnBu up to the blue on which black still shows.
pub(super) const SURFACE: [u32; 6] = [0xffffd9, 0xedf8b1, 0xc7e9b4, 0x7fcdbb, 0x41b6c4, 0x1d91c0];
/// Residuals, white is zero: ColorBrewer's RdBu, reversed, blue nearer than the plane, red farther.
pub(super) const RESIDUALS: [u32; 5] = [0x054a96, 0x67a9d6, 0xffffff, 0xef8a62, 0xa50f21];
/// ColorBrewer's Dark2 and two of Set1: distinguishable by colour-blind readers, at least four also in print.
const LINES: [u32; 8] =
    [0xd95f02, 0x7570b3, 0xe6ab02, 0x1b9e77, 0xe7298a, 0x377eb8, 0x66a61e, 0xa6761d];

/// Colour of the `i`-th of several lines without an order.
pub(super) fn line(i: usize) -> RGBColor {
    rgb(LINES[i % LINES.len()])
}

/// The same hue, darkened for a thin line: at full lightness the last of the distances' colours is lost on
/// white.
pub(super) fn darker(RGBColor(r, g, b): RGBColor) -> RGBColor {
    /// Factor at which even the lightest colour keeps a contrast of 4.5 to white (WCAG 2.1, 1.4.3).
    const DARKER: f64 = 0.58;
    let dim = |c: u8| (f64::from(c) * DARKER).round() as u8;
    RGBColor(dim(r), dim(g), dim(b))
}

/// Splits `0xrrggbb` into its bytes.
fn rgb(colour: u32) -> RGBColor {
    let [_, r, g, b] = colour.to_be_bytes();
    RGBColor(r, g, b)
}

/// Interpolates linearly between evenly spaced anchors; `share` runs from 0 to 1.
pub(super) fn between(anchors: &[u32], share: f64) -> RGBColor {
    let last = anchors.len() - 1;
    let at = share.clamp(0.0, 1.0) * last as f64;
    let i = (at as usize).min(last - 1);
    let [RGBColor(r0, g0, b0), RGBColor(r1, g1, b1)] = [anchors[i], anchors[i + 1]].map(rgb);
    let mix =
        |a: u8, b: u8| (f64::from(a) + (at - i as f64) * (f64::from(b) - f64::from(a))).round();
    RGBColor(mix(r0, r1) as u8, mix(g0, g1) as u8, mix(b0, b1) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance of sRGB, as WCAG 2.1 defines it.
    fn luminance(RGBColor(r, g, b): RGBColor) -> f64 {
        let linear = |c: u8| {
            let c = f64::from(c) / 255.0;
            if c <= 0.03928 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
    }

    #[test]
    fn thin_lines_stand_out_from_white() {
        for i in 0..=20 {
            let line = darker(between(&DISTANCES, f64::from(i) / 20.0));
            assert!(1.05 / (luminance(line) + 0.05) >= 4.5, "{line:?}");
        }
    }

    #[test]
    fn luminance_is_ordered() {
        for i in 0..20 {
            let [a, b] = [f64::from(i) / 20.0, f64::from(i + 1) / 20.0];
            let rises = |of: &[u32], a, b| luminance(between(of, a)) < luminance(between(of, b));
            assert!(rises(&DISTANCES, a, b) && rises(&SURFACE, b, a));
            assert!(rises(&RESIDUALS, 0.5 * a, 0.5 * b));
            assert!(rises(&RESIDUALS, 0.5 + 0.5 * b, 0.5 + 0.5 * a));
        }
    }
}
