//! The message types that are read: images, cameras, temperatures, single values.

pub use super::wire::{Damage, Dialect, Wire};

/// sensor_msgs/Image without its pixels, or sensor_msgs/CompressedImage without its data.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageHead {
    /// 0 if the message has no timestamp.
    pub stamp_ns: i64,
    pub frame_id: String,
    pub size: (usize, usize),
    /// "16UC1"; for a compressed image, its format.
    pub encoding: String,
    pub big_endian: bool,
    /// Row stride in bytes.
    pub step: usize,
    /// Offset of the data in the message, and its announced length in bytes.
    pub data_at: usize,
    pub data: usize,
}

/// Enough bytes of a message for its header, given names of sensible length.
pub const HEAD_BYTES: u64 = 4096;

fn header(wire: &mut Wire) -> Result<(i64, String), Damage> {
    if wire.dialect == Dialect::Ros1 {
        wire.u32()?;
    }
    let (seconds, ns) = (wire.u32()?, wire.u32()?);
    Ok((i64::from(seconds) * 1_000_000_000 + i64::from(ns), wire.text()?))
}

impl ImageHead {
    /// Reads the header of a raw image, or of a compressed one, whose size is in its data.
    pub fn read(bytes: &[u8], dialect: Dialect, is_raw: bool) -> Result<Self, Damage> {
        let mut wire = Wire::new(bytes, dialect)?;
        let (stamp_ns, frame_id) = header(&mut wire)?;
        let [height, width] = if is_raw { [wire.u32()?, wire.u32()?] } else { [0; 2] };
        let (encoding, big_endian) = (wire.text()?, is_raw && wire.u8()? != 0);
        let step = if is_raw { wire.u32()? as usize } else { 0 };
        let data = wire.u32()? as usize;
        let (data_at, size) = (bytes.len() - wire.left(), (width as usize, height as usize));
        Ok(ImageHead { stamp_ns, frame_id, size, encoding, big_endian, step, data_at, data })
    }
}

/// sensor_msgs/CameraInfo.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraInfo {
    pub size: (usize, usize),
    pub model: String,
    pub distortion: Vec<f64>,
    /// fx, fy, cx, cy of K, and of P for the rectified image.
    pub intrinsics: [f64; 4],
    pub rectified: [f64; 4],
}

impl CameraInfo {
    pub fn read(bytes: &[u8], dialect: Dialect) -> Result<Self, Damage> {
        let mut wire = Wire::new(bytes, dialect)?;
        header(&mut wire)?;
        let (height, width) = (wire.u32()? as usize, wire.u32()? as usize);
        let (model, distortion) = (wire.text()?, wire.f64s()?);
        let mut matrix = |n: usize| (0..n).map(|_| wire.f64()).collect::<Result<Vec<f64>, _>>();
        let (k, _, p) = (matrix(9)?, matrix(9)?, matrix(12)?);
        let size = (width, height);
        let intrinsics = [k[0], k[4], k[2], k[5]];
        let rectified = [p[0], p[5], p[2], p[6]];
        Ok(CameraInfo { size, model, distortion, intrinsics, rectified })
    }
}

/// sensor_msgs/Temperature: timestamp, ns, and degrees Celsius.
pub fn temperature(bytes: &[u8], dialect: Dialect) -> Result<(i64, f64), Damage> {
    let mut wire = Wire::new(bytes, dialect)?;
    let (stamp_ns, _) = header(&mut wire)?;
    Ok((stamp_ns, wire.f64()?))
}

/// std_msgs/Float32.
pub fn float32(bytes: &[u8], dialect: Dialect) -> Result<f32, Damage> {
    Wire::new(bytes, dialect)?.f32()
}

/// diagnostic_msgs/KeyValue.
pub fn key_value(bytes: &[u8], dialect: Dialect) -> Result<(String, String), Damage> {
    let mut wire = Wire::new(bytes, dialect)?;
    Ok((wire.text()?, wire.text()?))
}

/// Timestamp in seconds: the double nearest to the decimals that a text file of it would hold.
pub fn seconds(ns: i64) -> f64 {
    let (whole, part) = (ns.div_euclid(1_000_000_000), ns.rem_euclid(1_000_000_000));
    format!("{whole}.{part:09}").parse().unwrap_or(ns as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    #[test]
    fn stamps_are_the_nearest_number_to_their_decimals() {
        assert_eq!(super::seconds(1_305_031_102_175_304_001), 1_305_031_102.175_304);
        assert_eq!(super::seconds(33_333_333), 0.033_333_333);
    }
}
