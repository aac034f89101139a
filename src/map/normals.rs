//! Normals by principal components: the direction in which a voxel and its neighbours vary least.

use nalgebra::Vector3;

use super::noise::Noise;
use super::point::Point;
use super::voxel::{Voxel, Voxels};

/// Fewer pixels make no surface.
const FEWEST: f32 = 6.0;
/// The middle principal variance over the greatest: less is a line, whose normal is anybody's guess.
const THINNEST: f64 = 0.01;

/// The points of a voxel grid with the normals of their neighbourhoods, which are all pixels in the
/// 3 x 3 x 3 cubes around each. Voxels without a surface are left out.
pub fn points_of(voxels: &Voxels, noise: &Noise) -> Vec<Point> {
    let point = |index: usize| {
        let around = neighbourhood(voxels, index);
        let normal = normal_of(&around)?;
        let at = voxels.mean(index);
        let normal = if normal.dot(&at) > 0.0 { -normal } else { normal };
        let axial = noise.axial(at.z, &normal);
        let voxel = &voxels.voxels[index];
        let across = noise.across(axial, &at, &normal, voxel.n);
        Some(Point { at, normal, axial, across, pixel: voxel.pixel })
    };
    (0..voxels.voxels.len()).filter_map(point).collect()
}

fn neighbourhood(voxels: &Voxels, index: usize) -> Voxel {
    let mut around = Voxel { pixel: voxels.voxels[index].pixel, ..Voxel::default() };
    let place = voxels.cells.place(index);
    let (low, high) = (place.map(|v| v - 1), place.map(|v| v + 1));
    voxels.cells.each_within(low, high, |other| {
        let [x, y, z] = voxels.cells.place(other);
        let apart = [x - place[0], y - place[1], z - place[2]].map(|v| v as f32);
        around.merge(&voxels.voxels[other], Vector3::from(apart) * voxels.side_m);
    });
    around
}

/// Unit vector along which the points vary least; `None` where they are few or on a line.
fn normal_of(v: &Voxel) -> Option<Vector3<f32>> {
    if v.n < FEWEST {
        return None;
    }
    let n = f64::from(v.n);
    let m = v.sum.map(f64::from) / n;
    let q = v.squares.map(|s| f64::from(s) / n);
    let covariance = [
        q[0] - m.x * m.x,
        q[1] - m.x * m.y,
        q[2] - m.x * m.z,
        q[3] - m.y * m.y,
        q[4] - m.y * m.z,
        q[5] - m.z * m.z,
    ];
    let ([least, middle, most], direction) = min_direction(covariance)?;
    // A sphere of noise has no normal either: twice as thick as a plane may be.
    (middle > THINNEST * most && least < 0.5 * middle).then(|| direction.cast())
}

/// Eigenvalues, ascending, and the unit eigenvector of the least, of the symmetric matrix with
/// these xx, xy, xz, yy, yz, zz: in closed form, by the cosine of a third of an angle (Smith 1961).
fn min_direction(m: [f64; 6]) -> Option<([f64; 3], Vector3<f64>)> {
    let [xx, xy, xz, yy, yz, zz] = m;
    let mean = (xx + yy + zz) / 3.0;
    let (a, b, c) = (xx - mean, yy - mean, zz - mean);
    let off = xy * xy + xz * xz + yz * yz;
    let p = ((a * a + b * b + c * c + 2.0 * off) / 6.0).sqrt();
    if p.is_nan() || p <= 0.0 {
        return None;
    }
    let det = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz);
    let angle = (det / (2.0 * p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    let third = 2.0 * std::f64::consts::FRAC_PI_3;
    let most = mean + 2.0 * p * angle.cos();
    let least = mean + 2.0 * p * (angle + third).cos();
    let middle = 3.0 * mean - most - least;
    // Rows of M - least I are across the eigenvector: the longest of their products is along it.
    let rows = [
        Vector3::new(xx - least, xy, xz),
        Vector3::new(xy, yy - least, yz),
        Vector3::new(xz, yz, zz - least),
    ];
    let products = [rows[0].cross(&rows[1]), rows[0].cross(&rows[2]), rows[1].cross(&rows[2])];
    let longest = products
        .into_iter()
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
        .unwrap_or_default();
    let direction = longest.try_normalize(f64::MIN_POSITIVE)?;
    Some(([least, middle, most], direction))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, SymmetricEigen};
    use proptest::prelude::*;

    proptest! {
        /// Against nalgebra's iteration.
        #[test]
        fn the_min_direction_is_an_eigenvector(a in prop::array::uniform9(-1.0f64..1.0)) {
            let half = Matrix3::from_row_slice(&a);
            let m = half * half.transpose() + Matrix3::from_diagonal_element(1e-3);
            let told = min_direction([
                m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)],
            ]);
            let mut values: Vec<f64> = SymmetricEigen::new(m).eigenvalues.iter().copied().collect();
            values.sort_by(f64::total_cmp);
            let (found, direction) = told.unwrap();
            prop_assert!((found[0] - values[0]).abs() < 1e-8 * values[2]);
            prop_assert!((found[1] - values[1]).abs() < 1e-8 * values[2]);
            if values[1] - values[0] > 1e-3 * values[2] {
                prop_assert!((m * direction - direction * values[0]).norm() < 1e-6 * values[2]);
            }
        }
    }
}
