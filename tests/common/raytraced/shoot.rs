//! Taking a view: what stands still is worked out once, then frame by frame.

use rand::Rng;

use super::eye::{Eye, World};
use super::geometry::Site;
use super::kernels::{fresh, white};
use super::poses::Plan;
use super::sets::Set;
use super::{Act, Cause, Clock, Facts, Phase, Shake, Unit};
use kinoise::frame::{DepthCode, Frame};

/// Landau, Choo and Beling 2015: 10-bit numbers from a white surface 1 m away, and read noise.
const DN_AT_1_M: f64 = 590.0;
const READ_DN: f64 = 10.4;
/// What an office's light adds to a white surface.
const DN_A_LUX: f64 = 0.06;

/// Words a metre, 1/m.
pub fn units(unit: &Unit) -> f64 {
    match unit.sensor.code {
        DepthCode::Metric { units_per_metre, .. } => units_per_metre,
        DepthCode::Disparity { .. } => f64::NAN,
    }
}

/// A view that stands still: a number a pixel each.
pub struct Still<'a> {
    set: &'a Set,
    plan: &'a Plan,
    view: usize,
    /// Matched, px; NaN where nothing is.
    pub disparity: Vec<f32>,
    /// m.
    pub sigma: Vec<f32>,
    gain: Vec<f32>,
    loss: Vec<f32>,
    on_board: Vec<bool>,
    /// Noise of the depth from a trembling ray: inverse depth a px, 1/m.
    slope: Vec<f32>,
    light: Vec<f32>,
}

/// What the causes of a pixel come to.
pub(super) struct Sum {
    /// px.
    pub error: f64,
    /// Factor on sigma.
    pub spread: f64,
    /// Factor on the stored depth.
    pub gain: f64,
    /// Probability of an answer.
    pub answer: f64,
}

impl Sum {
    pub fn of(causes: &[Cause], site: &Site, facts: &Facts<'_>) -> Self {
        let mut sum = Sum { error: 0.0, spread: 1.0, gain: 1.0, answer: 1.0 };
        for cause in causes {
            match &cause.act {
                Act::Mismatch(f) => sum.error += f(site, facts),
                Act::Spread(f) => sum.spread *= f(site, facts),
                Act::Gain(f) => sum.gain *= f(site, facts),
                Act::Loss(f) => sum.answer *= 1.0 - f(site, facts),
                _ => {}
            }
        }
        sum
    }
}

/// Inverse depth a pixel to the side along the slope, 1/m.
pub(super) fn slope(unit: &Unit, plan: &Plan) -> f64 {
    let (c, board) = (&unit.sensor.camera, &plan.stage.board);
    (board.normal.x / c.fx).hypot(board.normal.y / c.fy) / board.reach
}

impl<'a> Still<'a> {
    pub fn new(set: &'a Set, view: usize) -> Self {
        let plan = &set.plans[view];
        let (w, h) = (set.unit.sensor.camera.width, set.unit.sensor.camera.height);
        let n = w * h;
        let mut still = Still {
            set,
            plan,
            view,
            disparity: vec![f32::NAN; n],
            sigma: vec![0.0; n],
            gain: vec![1.0; n],
            loss: vec![0.0; n],
            on_board: vec![false; n],
            slope: vec![0.0; n],
            light: vec![0.0; n],
        };
        let eye = Eye::new(World { causes: &set.causes, ..set.world() }, plan);
        let facts = plan.facts();
        let rounding = 1.0 / (12.0 * units(&set.unit).powi(2));
        for i in 0..n {
            let Some(site) = eye.look((i % w) as f64, (i / w) as f64) else { continue };
            still.settle(i, &site, &facts, rounding);
        }
        still
    }

    fn settle(&mut self, i: usize, site: &Site, facts: &Facts<'_>, rounding: f64) {
        let sum = Sum::of(&self.set.causes, site, facts);
        let base = self.set.unit.sigma(site.z, site.theta);
        self.disparity[i] = (site.disparity + sum.error) as f32;
        // The stored number's own rounding is part of what was calibrated.
        self.sigma[i] = (sum.spread * (base * base - rounding).max(0.0).sqrt()) as f32;
        self.gain[i] = sum.gain as f32;
        self.loss[i] = (1.0 - sum.answer) as f32;
        self.on_board[i] = site.on_board;
        if site.on_board {
            self.slope[i] = slope(&self.set.unit, self.plan) as f32;
        }
        let lit = site.facing / site.point.norm_squared();
        self.light[i] = (site.albedo * (DN_AT_1_M * lit + DN_A_LUX * facts.lux)) as f32;
    }

    /// Probability of no answer.
    #[cfg(test)]
    pub fn loss(&self) -> &[f32] {
        &self.loss
    }

    fn clock(&self, frame: usize) -> Clock {
        let view_s = self.plan.stamps[frame] - self.plan.stamps[0];
        let width = self.set.unit.sensor.camera.width;
        Clock { seed: self.set.seed, view: self.view, frame: frame as i64, view_s, width }
    }

    fn acts(&self) -> impl Iterator<Item = &Act> {
        self.set.causes.iter().map(|c: &Cause| &c.act)
    }

    /// Noise of unit variance.
    pub fn noise(&self, frame: usize) -> Vec<f32> {
        let clock = self.clock(frame);
        let mut field = fresh(clock.seed, clock.view, clock.frame, self.disparity.len());
        for phase in Phase::ALL {
            for act in self.acts() {
                if let Act::Grain(at, shape) = act
                    && *at == phase
                {
                    shape(&mut field, &clock);
                }
            }
        }
        field
    }

    fn shake(&self, clock: &Clock) -> Shake {
        let camera = &self.set.unit.sensor.camera;
        let mut shake = Shake { rows: vec![0.0; camera.height], columns: vec![0.0; camera.width] };
        self.acts().for_each(|act| {
            if let Act::Shake(f) = act {
                f(clock, &mut shake);
            }
        });
        shake
    }

    /// Depth, m, as the driver has it before it is stored; NaN where nothing is.
    pub fn depth(&self, frame: usize) -> Vec<f32> {
        let clock = self.clock(frame);
        let fb = self.set.unit.disparity_px_m() as f32;
        let Shake { rows, columns } = self.shake(&clock);
        let reach = self.plan.stage.board.reach;
        let gone: f64 =
            self.acts().map(|a| if let Act::Move(f) = a { f(&clock) } else { 0.0 }).sum();
        let nearer = (1.0 + gone / reach) as f32;
        let noise = self.noise(frame);
        let mut depth = vec![f32::NAN; noise.len()];
        for (v, row) in depth.chunks_exact_mut(clock.width).enumerate() {
            for (u, z) in row.iter_mut().enumerate() {
                let i = v * clock.width + u;
                let moved = if self.on_board[i] { nearer } else { 1.0 };
                *z = moved * fb / (self.disparity[i] + rows[v] + columns[u]);
            }
        }
        self.tremble(&mut depth, &clock);
        for ((z, sigma), noise) in depth.iter_mut().zip(&self.sigma).zip(&noise) {
            *z += sigma * noise;
        }
        self.read_out(&mut depth, fb);
        self.lose(&mut depth, &clock);
        depth
    }

    fn tremble(&self, depth: &mut [f32], clock: &Clock) {
        for act in self.acts() {
            let Act::Wander(px) = act else { continue };
            let name = format!("rays/wander/{}/{}", clock.view, clock.frame);
            let steps = white(depth.len(), clock.seed.stream(&name));
            for ((z, slope), step) in depth.iter_mut().zip(&self.slope).zip(steps) {
                *z /= 1.0 + *z * slope * *px as f32 * step;
            }
        }
    }

    fn read_out(&self, depth: &mut [f32], fb: f32) {
        for act in self.acts() {
            if let Act::Lattice { step, phase } = act {
                let (step, phase) = (*step as f32, *phase as f32);
                depth
                    .iter_mut()
                    .for_each(|z| *z = fb / (((fb / *z / step - phase).round() + phase) * step));
            }
        }
        depth.iter_mut().zip(&self.gain).for_each(|(z, gain)| *z *= gain);
        for act in self.acts() {
            if let Act::Floor(step) = act {
                let step = *step as f32;
                depth.iter_mut().for_each(|z| *z = (*z / step).floor() * step);
            }
        }
    }

    fn lose(&self, depth: &mut [f32], clock: &Clock) {
        if !self.acts().any(|a| matches!(a, Act::Loss(_))) {
            return;
        }
        let name = format!("rays/lost/{}/{}", clock.view, clock.frame);
        let mut rng = clock.seed.stream(&name);
        for (z, loss) in depth.iter_mut().zip(&self.loss) {
            if rng.random::<f32>() < *loss {
                *z = f32::NAN;
            }
        }
    }

    /// As stored.
    pub fn words(&self, frame: usize) -> Frame {
        let scale = units(&self.set.unit) as f32;
        let word = |z: &f32| {
            let exact = (z * scale).round();
            if exact > 0.0 && exact < 65536.0 { exact as u16 } else { 0 }
        };
        let camera = &self.set.unit.sensor.camera;
        let words = self.depth(frame).iter().map(word).collect();
        Frame { width: camera.width, height: camera.height, raw: words }
    }

    /// Amplitude, 10-bit numbers.
    pub fn infrared(&self, frame: usize) -> Vec<u16> {
        let name = format!("rays/infrared/{}/{frame}", self.view);
        let noise = white(self.light.len(), self.set.seed.stream(&name));
        let number = |(light, n): (&f32, f32)| {
            let sd = (f64::from(*light) / 10.0 + READ_DN * READ_DN).sqrt() as f32;
            (light + sd * n).round().clamp(0.0, 1023.0) as u16
        };
        self.light.iter().zip(noise).map(number).collect()
    }
}
