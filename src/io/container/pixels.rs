//! Decodes the depths of an image message.

use super::messages::{Damage, ImageHead};
use crate::camera::usable_size;
use crate::io::images::png16;

/// Depths of all pixels, row-major.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// In a unit stated elsewhere; 0 is no measurement.
    Words(Vec<u16>),
    /// NaN, infinite or 0 where there is no measurement.
    Metres(Vec<f32>),
}

/// How a topic's depth is stored: as words or metres (in compressed images, quantised inverse depths), and
/// raw or as a 16-bit PNG after a header of compressed_depth_image_transport.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Encoding {
    pub is_raw: bool,
    pub is_float: bool,
}

/// Length of the header before the PNG: an enumeration and two floats.
const HEADER: usize = 12;

impl Encoding {
    /// Parses a raw image's encoding, or a compressed image's format: "16UC1; compressedDepth png".
    pub fn of(said: &str, is_raw: bool) -> Option<Self> {
        let (encoding, how) = if is_raw { (said, "") } else { said.split_once(';')? };
        if !is_raw && (!how.contains("compressedDepth") || how.contains("rvl")) {
            return None;
        }
        let is_float = match encoding.trim() {
            "16UC1" | "mono16" => false,
            "32FC1" => true,
            _ => return None,
        };
        Some(Encoding { is_raw, is_float })
    }

    fn pixel_bytes(self) -> usize {
        if self.is_float { 4 } else { 2 }
    }

    /// What is wrong with a header in a message of `length` bytes, before its pixels are read.
    pub fn fault(self, head: &ImageHead, length: u64) -> Option<Damage> {
        let (width, height) = head.size;
        if (head.data_at + head.data) as u64 > length {
            let left = length.saturating_sub(head.data_at as u64);
            return Some(format!("{} bytes of image are announced, {left} are there", head.data));
        }
        if !self.is_raw {
            return None;
        }
        if !usable_size(width, height) {
            return Some(format!("an image of {width} x {height} px is no depth image"));
        }
        let row = width * self.pixel_bytes();
        (head.step < row || head.step.checked_mul(height) != Some(head.data)).then(|| {
            format!(
                "{} bytes in rows of {} do not make an image of {width} x {height} px",
                head.data, head.step
            )
        })
    }

    /// Size and depths of a complete message.
    pub fn decode(
        self,
        head: &ImageHead,
        message: &[u8],
    ) -> Result<((usize, usize), Pixels), Damage> {
        if let Some(fault) = self.fault(head, message.len() as u64) {
            return Err(fault);
        }
        let data = &message[head.data_at..head.data_at + head.data];
        if !self.is_raw {
            return self.decode_compressed(data);
        }
        let (width, height) = head.size;
        let row = width * self.pixel_bytes();
        let rows = (0..height).map(|v| &data[v * head.step..][..row]);
        let pixels = match (self.is_float, head.big_endian) {
            (false, false) => Pixels::Words(each(rows, u16::from_le_bytes)),
            (false, true) => Pixels::Words(each(rows, u16::from_be_bytes)),
            (_, false) => Pixels::Metres(each(rows, f32::from_le_bytes)),
            (_, true) => Pixels::Metres(each(rows, f32::from_be_bytes)),
        };
        Ok((head.size, pixels))
    }

    fn decode_compressed(self, data: &[u8]) -> Result<((usize, usize), Pixels), Damage> {
        let Some((header, png)) = data.split_at_checked(HEADER) else {
            return Err(format!("{} bytes are no compressed depth image", data.len()));
        };
        let frame = png16(png).map_err(|(what, _)| what)?;
        let size = (frame.width, frame.height);
        if !self.is_float {
            return Ok((size, Pixels::Words(frame.raw)));
        }
        let float = |at: usize| {
            let b = &header[at..at + 4];
            f32::from_le_bytes([b[0], b[1], b[2], b[3]])
        };
        let (a, b) = (float(4), float(8));
        if !(a.is_finite() && a > 0.0 && b.is_finite()) {
            return Err(format!("depth = {a} / (value - {b}) makes no depth"));
        }
        let metres = |word: &u16| if *word == 0 { f32::NAN } else { a / (f32::from(*word) - b) };
        Ok((size, Pixels::Metres(frame.raw.iter().map(metres).collect())))
    }
}

pub fn each<'a, T, const N: usize>(
    rows: impl Iterator<Item = &'a [u8]>,
    of: fn([u8; N]) -> T,
) -> Vec<T> {
    rows.flat_map(|row| row.as_chunks().0).map(|number| of(*number)).collect()
}
