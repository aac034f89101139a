//! The infrared camera's chip: 10 bits, shot and read noise.

use super::causes::Causes;
use super::picture::Picture;
use crate::effects::fill_normal;
use crate::frame::Frame;
use crate::rng::Stream;

/// A 10-bit sensor of this class fills up at some 10,000 electrons.
const ELECTRONS_PER_DN: f32 = 10.0;
/// What 10 bits hold.
const FULL_DN: f32 = 1023.0;
/// Black is lifted by four read noises, so that 10 bits without a sign cut nothing off.
const BLACK_DN: f32 = 42.0;

/// Light that is there without the projector, DN.
pub enum Ambient {
    None,
    /// Per pixel, row-major.
    Light(Vec<f32>),
}

impl Ambient {
    fn at(&self, i: usize) -> f32 {
        match self {
            Ambient::None => 0.0,
            Ambient::Light(dn) => dn[i],
        }
    }
}

/// One exposure of the chip.
pub fn expose(picture: &Picture, ambient: &Ambient, causes: &Causes, rng: &mut Stream) -> Frame {
    let mut noise = vec![0f32; picture.dn.len()];
    fill_normal(&mut noise, rng);
    let read = (causes.read_noise_dn * causes.read_noise_dn) as f32;
    let words = picture.dn.iter().zip(&noise).enumerate().map(|(i, (dots, noise))| {
        let light = dots + ambient.at(i);
        let sd = (light / ELECTRONS_PER_DN + read).sqrt();
        (BLACK_DN + light + sd * noise).round().clamp(0.0, FULL_DN) as u16
    });
    Frame { width: picture.width, height: picture.height, raw: words.collect() }
}
