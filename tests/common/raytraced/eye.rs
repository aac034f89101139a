//! What a pixel sees through the lens: the board, or what lies behind it.

use nalgebra::Vector3;

use super::geometry::inside_px;
use super::poses::{Plan, outline};
use super::{Act, Cause, Unit};

/// Nothing answers from farther away, m.
const FARTHEST_M: f64 = 12.0;
/// Albedo of a wall behind the board.
const WALL_ALBEDO: f64 = 0.6;

/// A pixel, and what it looks at.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    pub u: f64,
    pub v: f64,
    /// Distance from the principal point over that of the farthest corner.
    pub radius: f64,
    /// The ray (x, y, 1) by the camera's description.
    pub x: f64,
    pub y: f64,
    /// Depth along the optical axis, m.
    pub z: f64,
    /// Column here minus column at the projector, px.
    pub disparity: f64,
    pub point: Vector3<f64>,
    pub on_board: bool,
    /// Position on the board, m from its centre.
    pub place: [f64; 2],
    /// Tilt of the surface, rad.
    pub theta: f64,
    /// Cosine of the angle between ray and normal.
    pub facing: f64,
    /// Distance to the board's outline in the image, px; positive on the board.
    pub edge_px: f64,
    /// Disparity of the other surface at this pixel, px.
    pub other_disparity: Option<f64>,
    /// Share of the light that is reflected.
    pub albedo: f64,
}

/// A unit and the causes that act on it.
#[derive(Clone, Copy)]
pub struct World<'a> {
    pub unit: &'a Unit,
    pub causes: &'a [Cause],
    /// Whether grey patches are printed on the board.
    pub printed: bool,
    /// Whether some cause needs the distance to the board's edge.
    pub edged: bool,
}

/// A camera in front of a stage.
#[derive(Clone, Copy)]
pub struct Eye<'a> {
    pub world: World<'a>,
    pub plan: &'a Plan,
    corner_px: f64,
    /// Outline of the board in the image, if a cause needs it.
    outline: Option<[[f64; 2]; 4]>,
}

impl<'a> Eye<'a> {
    pub fn new(world: World<'a>, plan: &'a Plan) -> Self {
        let c = &world.unit.sensor.camera;
        let (right, bottom) = (c.width as f64 - 1.0, c.height as f64 - 1.0);
        let corner_px = c.cx.max(right - c.cx).hypot(c.cy.max(bottom - c.cy));
        let corners = plan.stage.board.corners(0.0).filter(|_| world.edged);
        Eye { world, plan, corner_px, outline: corners.and_then(|c| outline(world.unit, &c)) }
    }

    /// The same view with these causes.
    pub fn with<'b>(&self, causes: &'b [Cause]) -> Eye<'b>
    where
        'a: 'b,
    {
        Eye { world: World { causes, ..self.world }, ..*self }
    }

    fn acting(&self) -> impl Iterator<Item = &Cause> {
        self.world.causes.iter().filter(|cause| cause.acts_in(self.plan))
    }

    /// What the pixel's ray meets first.
    pub fn look(&self, u: f64, v: f64) -> Option<Site> {
        let c = &self.world.unit.sensor.camera;
        let (x, y) = c.ray(u, v);
        let mut ray = (x, y);
        for cause in self.acting() {
            if let Act::Ray(bend) = &cause.act {
                ray = bend(ray.0, ray.1);
            }
        }
        let ray = Vector3::new(ray.0, ray.1, 1.0);
        let stage = &self.plan.stage;
        let z_board = self.board_depth(&ray);
        let place = stage.board.place(&(ray * z_board));
        let hit = z_board > 0.0 && z_board < FARTHEST_M;
        let on_board = hit && stage.board.holds(place);
        let z = if on_board { z_board } else { stage.wall? };
        let other = if on_board { stage.wall } else { Some(z_board).filter(|_| hit) };
        let point = ray * z;
        let fb = self.world.unit.disparity_px_m();
        let normal = if on_board { stage.board.normal } else { Vector3::z() };
        // Column at which the projector sees the point that the camera, by its described rays, sees here.
        let column = c.cx + c.fx * (x * z - self.world.unit.baseline_m) / z;
        Some(Site {
            u,
            v,
            x,
            y,
            z,
            point,
            on_board,
            place,
            radius: (u - c.cx).hypot(v - c.cy) / self.corner_px,
            disparity: u - column,
            theta: if on_board { stage.theta } else { 0.0 },
            facing: normal.dot(&ray) / ray.norm(),
            edge_px: self.outline.map_or(f64::INFINITY, |o| inside_px(&o, u, v)),
            other_disparity: other.map(|z| fb / z),
            albedo: self.albedo(on_board, place),
        })
    }

    fn board_depth(&self, ray: &Vector3<f64>) -> f64 {
        let board = &self.plan.stage.board;
        let flat = board.reach / board.normal.dot(ray);
        let lift = |z: f64| {
            let place = board.place(&(ray * z));
            let rise = |cause: &Cause| if let Act::Lift(f) = &cause.act { f(place) } else { 0.0 };
            self.acting().map(rise).sum::<f64>()
        };
        if !self.acting().any(|c| matches!(c.act, Act::Lift(_))) {
            return flat;
        }
        // A few millimetres of rise move the position on the board by less: three iterations settle it.
        (0..3).fold(flat, |z, _| flat * (1.0 - lift(z) / board.reach))
    }

    fn albedo(&self, on_board: bool, [p, q]: [f64; 2]) -> f64 {
        const GREYS: [f64; 5] = [0.8, 0.5, 0.3, 0.2, 0.12];
        const PATCH_M: f64 = 0.12;
        if !on_board {
            return WALL_ALBEDO;
        }
        if !self.world.printed {
            return GREYS[0];
        }
        let (i, j) = ((p / PATCH_M).floor() as i64, (q / PATCH_M).floor() as i64);
        GREYS[(i + 2 * j).rem_euclid(5) as usize]
    }
}
