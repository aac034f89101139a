//! Spots become pixels, and pixels the 10-bit numbers of an infrared camera.

use super::causes::Causes;
use super::optics::Spot;
use crate::effects::fill_normal;
use crate::frame::Frame;
use crate::rng::Stream;

/// A picture in DN, before noise; its first column may lie outside the camera's image.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    pub width: usize,
    pub height: usize,
    /// Column of the camera's image that is the first of this picture, px.
    pub first_column: i64,
    pub dn: Vec<f32>,
}

/// A Gaussian ends where it has fallen to 1/500: below the noise of any single pixel.
const REACH_SIGMA: f64 = 3.5;
/// At grazing incidence a dot becomes a streak; what is longer is spread too thin to be seen, px.
const LONGEST_PX: f64 = 20.0;

impl Picture {
    pub fn dark(width: usize, height: usize, first_column: i64) -> Self {
        Picture { width, height, first_column, dn: vec![0.0; width * height] }
    }

    pub fn with(mut self, spots: &[Spot]) -> Self {
        spots.iter().for_each(|spot| self.add(spot));
        self
    }

    fn add(&mut self, spot: &Spot) {
        let c = &spot.covariance;
        let Some(inverse) = c.try_inverse() else { return };
        let (a, b, d) = (-0.5 * inverse[(0, 0)], -inverse[(0, 1)], -0.5 * inverse[(1, 1)]);
        let reach = |variance: f64| (REACH_SIGMA * variance.sqrt()).min(LONGEST_PX);
        let u0 = spot.u - self.first_column as f64;
        let columns = covered(u0, reach(c[(0, 0)]), self.width);
        for v in covered(spot.v, reach(c[(1, 1)]), self.height) {
            let dv = v as f64 - spot.v;
            let row = &mut self.dn[v * self.width..][..self.width];
            for u in columns.clone() {
                let du = u as f64 - u0;
                let exponent = a * du * du + b * du * dv + d * dv * dv;
                row[u] += (spot.peak * exponent.exp()) as f32;
            }
        }
    }
}

/// Pixels within `reach` of `centre`.
fn covered(centre: f64, reach: f64, size: usize) -> std::ops::Range<usize> {
    let low = (centre - reach).ceil().max(0.0);
    let high = (centre + reach).floor().min(size as f64 - 1.0);
    if low <= high { low as usize..high as usize + 1 } else { 0..0 }
}

/// A 10-bit sensor of this class fills up at some 10,000 electrons.
const ELECTRONS_PER_DN: f32 = 10.0;
/// What 10 bits hold.
const FULL_DN: f32 = 1023.0;
/// Black is lifted by four read noises, so that 10 bits without a sign cut nothing off.
const BLACK_DN: f32 = 42.0;

/// One exposure of the chip, with shot and read noise. `ambient` is the light that is there without
/// the projector, DN, row-major.
pub fn expose(
    picture: &Picture,
    ambient: Option<&[f32]>,
    causes: &Causes,
    rng: &mut Stream,
) -> Frame {
    let mut noise = vec![0f32; picture.dn.len()];
    fill_normal(&mut noise, rng);
    let read = (causes.read_noise_dn * causes.read_noise_dn) as f32;
    let words = picture.dn.iter().zip(&noise).enumerate().map(|(i, (dots, noise))| {
        let light = dots + ambient.map_or(0.0, |dn| dn[i]);
        let sd = (light / ELECTRONS_PER_DN + read).sqrt();
        (BLACK_DN + light + sd * noise).round().clamp(0.0, FULL_DN) as u16
    });
    Frame { width: picture.width, height: picture.height, raw: words.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix2;

    /// Centroid, total and slant of a spot against its own numbers.
    #[test]
    fn a_spot_keeps_its_place_light_and_slant() {
        let covariance = Matrix2::new(1.2, 0.4, 0.4, 0.7);
        let spot = Spot { u: 3.3, v: 9.6, peak: 100.0, covariance };
        let picture = Picture::dark(24, 20, -7).with(&[spot]);
        let (mut total, mut u, mut v, mut uv) = (0.0, 0.0, 0.0, 0.0);
        for (i, &dn) in picture.dn.iter().enumerate() {
            let (x, y, dn) = ((i % 24) as f64 - 7.0, (i / 24) as f64, f64::from(dn));
            total += dn;
            u += dn * x;
            v += dn * y;
            uv += dn * (x - 3.3) * (y - 9.6);
        }
        let expected = 100.0 * std::f64::consts::TAU * covariance.determinant().sqrt();
        assert!((total / expected - 1.0).abs() < 0.01, "{total} {expected}");
        assert!((u / total - 3.3).abs() < 0.01 && (v / total - 9.6).abs() < 0.01);
        assert!((uv / total - 0.4).abs() < 0.03, "{}", uv / total);
    }
}
