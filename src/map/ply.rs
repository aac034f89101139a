//! The map as a PLY file: binary, little-endian, as MeshLab and CloudCompare read it.

use super::grid_map::MapPoint;

/// A whole file: places, normals, colours and `sigma`, m.
pub fn ply(points: &[MapPoint]) -> Vec<u8> {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment kinoise map; metres; frame of the first camera\n\
         element vertex {}\n\
         property float x\nproperty float y\nproperty float z\n\
         property float nx\nproperty float ny\nproperty float nz\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property float sigma\nend_header\n",
        points.len()
    );
    let mut bytes = Vec::with_capacity(header.len() + points.len() * 31);
    bytes.extend_from_slice(header.as_bytes());
    for point in points {
        for v in point.at.iter().chain(point.normal.iter()) {
            bytes.extend_from_slice(&v.to_le_bytes());
        }
        bytes.extend_from_slice(&point.colour);
        bytes.extend_from_slice(&point.sigma.to_le_bytes());
    }
    bytes
}
