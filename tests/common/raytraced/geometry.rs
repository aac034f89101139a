//! What a pixel's ray meets: the board, or the wall behind it.

use nalgebra::{Matrix3, Vector3};

/// Weighted least squares of rows (columns, value, 1 over its variance): coefficients of the columns; `None`
/// where the rows do not determine them.
pub fn least_squares(rows: impl Iterator<Item = (Vector3<f64>, f64, f64)>) -> Option<Vector3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (x, value, weight) in rows {
        normal += x * x.transpose() * weight;
        right += x * (weight * value);
    }
    normal.cholesky().map(|c| c.solve(&right))
}

/// A flat board; infinite where it has no size.
#[derive(Debug, Clone)]
pub struct Board {
    /// Origin of its own coordinates, m.
    pub centre: Vector3<f64>,
    pub right: Vector3<f64>,
    pub down: Vector3<f64>,
    /// Away from the sensor, unit length.
    pub normal: Vector3<f64>,
    /// Distance of the plane from the sensor, m.
    pub reach: f64,
    /// Half width and half height, m.
    pub half: Option<[f64; 2]>,
}

impl Board {
    /// Board met by the optical axis at depth `z`, m, and tilted by `theta` so that depth grows towards
    /// `azimuth`. `aim` is the position on the board, m, where the axis meets it; `roll` is about its
    /// normal, rad.
    pub fn posed(z: f64, [theta, azimuth]: [f64; 2], aim: [f64; 2], roll: f64) -> Self {
        let uphill =
            Vector3::new(azimuth.cos() * theta.cos(), azimuth.sin() * theta.cos(), theta.sin());
        let level = Vector3::new(-azimuth.sin(), azimuth.cos(), 0.0);
        // Unrolled, the board's right is turned back by the azimuth within its plane.
        let turn = roll - azimuth;
        let right = uphill * turn.cos() + level * turn.sin();
        let down = level * turn.cos() - uphill * turn.sin();
        let centre = Vector3::new(0.0, 0.0, z) - right * aim[0] - down * aim[1];
        let normal = right.cross(&down);
        let normal = if normal.z < 0.0 { -normal } else { normal };
        Board { centre, right, down, normal, reach: normal.dot(&centre), half: None }
    }

    /// Depth along the ray (x, y, 1), m; infinite or negative where they do not meet.
    pub fn depth(&self, x: f64, y: f64) -> f64 {
        self.reach / self.normal.dot(&Vector3::new(x, y, 1.0))
    }

    pub fn place(&self, point: &Vector3<f64>) -> [f64; 2] {
        let off = point - self.centre;
        [off.dot(&self.right), off.dot(&self.down)]
    }

    pub fn holds(&self, [p, q]: [f64; 2]) -> bool {
        self.half.is_none_or(|[a, b]| p.abs() <= a && q.abs() <= b)
    }

    /// Corners, `inset` m inside its edge, in order around it.
    pub fn corners(&self, inset: f64) -> Option<[Vector3<f64>; 4]> {
        let [a, b] = self.half?.map(|h| h - inset);
        let corner = |(s, t): (f64, f64)| self.centre + self.right * (s * a) + self.down * (t * b);
        Some([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(corner))
    }
}

/// A board, and a wall facing the sensor behind it.
#[derive(Debug, Clone)]
pub struct Stage {
    pub board: Board,
    /// Depth of the wall, m.
    pub wall: Option<f64>,
    /// Tilt of the board and its azimuth, rad.
    pub theta: f64,
    pub azimuth: f64,
}

/// Signed distance, px, of (u, v) from a convex outline; positive inside.
pub fn inside_px(outline: &[[f64; 2]; 4], u: f64, v: f64) -> f64 {
    let side = |i: usize| {
        let ([ua, va], [ub, vb]) = (outline[i], outline[(i + 1) % 4]);
        let (du, dv) = (ub - ua, vb - va);
        (du * (v - va) - dv * (u - ua)) / du.hypot(dv)
    };
    let depth = (0..4).map(side).fold(f64::INFINITY, f64::min);
    if depth >= 0.0 { depth } else { -outside_px(outline, u, v) }
}

fn outside_px(outline: &[[f64; 2]; 4], u: f64, v: f64) -> f64 {
    let to_side = |i: usize| {
        let ([ua, va], [ub, vb]) = (outline[i], outline[(i + 1) % 4]);
        let (du, dv) = (ub - ua, vb - va);
        let along = ((u - ua) * du + (v - va) * dv) / (du * du + dv * dv);
        let t = along.clamp(0.0, 1.0);
        (u - ua - t * du).hypot(v - va - t * dv)
    };
    (0..4).map(to_side).fold(f64::INFINITY, f64::min)
}

/// Whether the board stands between `point` and the projector.
pub fn shaded(stage: &Stage, baseline_m: f64, point: &Vector3<f64>) -> bool {
    let lamp = Vector3::new(baseline_m, 0.0, 0.0);
    let normal = stage.board.normal;
    let (from, to) = (normal.dot(&lamp) - stage.board.reach, normal.dot(point) - stage.board.reach);
    if from * to >= 0.0 {
        return false;
    }
    let crossing = lamp + (point - lamp) * (from / (from - to));
    stage.board.holds(stage.board.place(&crossing))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_board_stands_where_it_was_put() {
        for azimuth in [0.0, 0.7, 1.6, 3.0, -2.0] {
            let board = Board::posed(1.7, [0.6, azimuth], [0.05, -0.03], 0.04);
            assert!((board.depth(0.0, 0.0) - 1.7).abs() < 1e-12);
            assert!((board.normal.z - 0.6f64.cos()).abs() < 1e-12, "tilt");
            assert!(board.right.dot(&board.down).abs() < 1e-12);
            let e = 0.01;
            assert!(board.depth(e * azimuth.cos(), e * azimuth.sin()) > 1.7, "uphill");
            assert!((board.depth(-e * azimuth.sin(), e * azimuth.cos()) - 1.7).abs() < 1e-12);
            let aim = board.place(&Vector3::new(0.0, 0.0, 1.7));
            assert!((aim[0] - 0.05).abs() < 1e-12 && (aim[1] + 0.03).abs() < 1e-12);
            assert!(board.right.x > 0.5, "its right is the picture's right");
        }
        let square = [[0.0, 0.0], [10.0, 0.0], [10.0, 6.0], [0.0, 6.0]];
        assert_eq!([(5.0, 2.0), (13.0, 10.0)].map(|(u, v)| inside_px(&square, u, v)), [2.0, -5.0]);
    }

    /// Similar triangles: fx b (1/z - 1/wall) px.
    #[test]
    fn the_shadow_is_as_wide_as_geometry_says() {
        let mut board = Board::posed(1.5, [0.0, 0.0], [0.0, 0.0], 0.0);
        board.half = Some([0.3, 0.2]);
        let stage = Stage { board, wall: Some(3.0), theta: 0.0, azimuth: 0.0 };
        let lost = (0..64_000).filter(|i| {
            let x = (f64::from(*i) / 100.0 - 320.0) / 580.0;
            let on_wall = (1.5 * x).abs() > 0.3;
            on_wall && shaded(&stage, 0.075, &(Vector3::new(x, 0.0, 1.0) * 3.0))
        });
        let width = lost.count() as f64 / 100.0;
        assert!((width - 580.0 * 0.075 * (1.0 / 1.5 - 1.0 / 3.0)).abs() < 0.02, "{width}");
    }
}
