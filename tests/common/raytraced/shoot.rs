//! Takes a view: computes what is constant once, then each frame.

use rand::Rng;

use super::eye::{Eye, Site, World};
use super::kernels::{fresh, white};
use super::poses::Plan;
use super::{Act, Cause, Clock, Set, Unit};
use kinoise::frame::Frame;

/// Landau, Choo and Beling 2015: 10-bit signal of a white surface 1 m away, and read noise.
const DN_AT_1_M: f64 = 590.0;
const READ_DN: f64 = 10.4;
/// Signal that a lux of room light adds on a white surface.
const DN_A_LUX: f64 = 0.06;

/// Combined effect of all causes on a pixel.
pub struct Sum {
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
    pub fn of(causes: &[Cause], site: &Site, plan: &Plan) -> Self {
        let mut sum = Sum { error: 0.0, spread: 1.0, gain: 1.0, answer: 1.0 };
        for cause in causes.iter().filter(|cause| cause.acts_at(site, plan)) {
            match &cause.act {
                Act::Mismatch(f) => sum.error += f(site, plan),
                Act::Spread(f) => sum.spread *= f(site, plan),
                Act::Gain(f) => sum.gain *= f(site, plan),
                Act::Loss(f) => sum.answer *= 1.0 - f(site, plan),
                _ => {}
            }
        }
        sum
    }

    /// Factor on the noise of the depth. The matcher's noise is one of the disparity: a shift carries it along.
    pub fn stretch(&self, site: &Site) -> f64 {
        self.spread * (site.disparity / (site.disparity + self.error)).powi(2)
    }
}

/// Change of inverse depth per pixel along the slope, 1/m.
pub fn slope(unit: &Unit, plan: &Plan) -> f64 {
    let (c, board) = (&unit.sensor.camera, &plan.stage.board);
    (board.normal.x / c.fx).hypot(board.normal.y / c.fy) / board.reach
}

/// Constant part of a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// Matched disparity, px; NaN where there is none.
    pub disparity: f32,
    /// m.
    pub sigma: f32,
    gain: f32,
    /// Probability of no answer.
    pub loss: f32,
    pub on_board: bool,
    /// Amplitude without noise, 10-bit numbers.
    light: f32,
}

const NOTHING: Pixel =
    Pixel { disparity: f32::NAN, sigma: 0.0, gain: 1.0, loss: 0.0, on_board: false, light: 0.0 };

/// Constant part of a view.
pub struct Still<'a> {
    set: &'a Set,
    plan: &'a Plan,
    pub pixels: Vec<Pixel>,
}

impl<'a> Still<'a> {
    pub fn new(set: &'a Set, view: usize) -> Self {
        let plan = &set.plans[view];
        let eye = Eye::new(World { causes: &set.causes, ..set.world() }, plan);
        let camera = &set.unit.sensor.camera;
        let rounding = 1.0 / (12.0 * set.unit.units_per_metre().powi(2));
        let pixel = |i: usize| {
            let site = eye.look((i % camera.width) as f64, (i / camera.width) as f64);
            site.map_or(NOTHING, |site| pixel(set, &site, plan, rounding))
        };
        Still { set, plan, pixels: (0..camera.pixels()).map(pixel).collect() }
    }

    fn clock(&self, frame: usize) -> Clock {
        let view_s = self.plan.stamps[frame] - self.plan.stamps[0];
        let width = self.set.unit.sensor.camera.width;
        Clock { seed: self.set.seed, view: self.plan.view, frame: frame as i64, view_s, width }
    }

    fn acts(&self) -> impl Iterator<Item = &'a Act> {
        let plan = self.plan;
        self.set.causes.iter().filter(|cause| cause.acts_in(plan)).map(|cause| &cause.act)
    }

    /// Noise of unit variance.
    pub fn noise(&self, frame: usize) -> Vec<f32> {
        let clock = self.clock(frame);
        let mut field = fresh(&clock, self.pixels.len());
        let grain = |act: &'a Act| match act {
            Act::Grain(phase, shape) => Some((*phase, shape)),
            _ => None,
        };
        let mut shapes: Vec<_> = self.acts().filter_map(grain).collect();
        shapes.sort_by_key(|(phase, _)| *phase);
        shapes.iter().for_each(|(_, shape)| shape(&mut field, &clock));
        field
    }

    /// Depth, m, as the driver has it before it is stored; NaN where there is none.
    pub fn depth(&self, frame: usize) -> Vec<f32> {
        let clock = self.clock(frame);
        let fb = self.set.unit.disparity_px_m() as f32;
        let mut rows = vec![0.0; self.set.unit.sensor.camera.height];
        let mut gone = 0.0;
        for act in self.acts() {
            match act {
                Act::Shake(f) => f(&clock, &mut rows),
                Act::Move(f) => gone += f(clock.view_s),
                _ => {}
            }
        }
        let nearer = (1.0 + gone / self.plan.stage.board.reach) as f32;
        let depth = |(i, pixel): (usize, &Pixel)| {
            let moved = if pixel.on_board { nearer } else { 1.0 };
            moved * fb / (pixel.disparity + rows[i / clock.width])
        };
        let mut depth: Vec<f32> = self.pixels.iter().enumerate().map(depth).collect();
        self.tremble(&mut depth, &clock);
        for ((z, pixel), noise) in depth.iter_mut().zip(&self.pixels).zip(self.noise(frame)) {
            *z += pixel.sigma * noise;
        }
        self.read_out(&mut depth, fb);
        self.lose(&mut depth, &clock);
        depth
    }

    /// Jitters the rays over the board's slope.
    fn tremble(&self, depth: &mut [f32], clock: &Clock) {
        let slope = slope(&self.set.unit, self.plan) as f32;
        for act in self.acts() {
            let Act::Wander(px) = act else { continue };
            let steps = white(depth.len(), clock.stream("wander"));
            for ((z, pixel), step) in depth.iter_mut().zip(&self.pixels).zip(steps) {
                let slope = if pixel.on_board { slope } else { 0.0 };
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
        depth.iter_mut().zip(&self.pixels).for_each(|(z, pixel)| *z *= pixel.gain);
        for act in self.acts() {
            if let Act::Floor(step) = act {
                let step = *step as f32;
                depth.iter_mut().for_each(|z| *z = (*z / step).floor() * step);
            }
        }
    }

    fn lose(&self, depth: &mut [f32], clock: &Clock) {
        if self.acts().any(|act| matches!(act, Act::Loss(_))) {
            let mut rng = clock.stream("lost");
            for (z, pixel) in depth.iter_mut().zip(&self.pixels) {
                *z = if rng.random::<f32>() < pixel.loss { f32::NAN } else { *z };
            }
        }
    }

    /// The depth frame as stored.
    pub fn words(&self, frame: usize) -> Frame {
        let scale = self.set.unit.units_per_metre() as f32;
        let word = |z: &f32| {
            let exact = (z * scale).round();
            if exact > 0.0 && exact < 65536.0 { exact as u16 } else { 0 }
        };
        self.image(self.depth(frame).iter().map(word).collect())
    }

    /// The infrared frame, 10-bit numbers.
    pub fn infrared(&self, frame: usize) -> Frame {
        let noise = white(self.pixels.len(), self.clock(frame).stream("infrared"));
        let number = |(pixel, n): (&Pixel, f32)| {
            let sd = (f64::from(pixel.light) / 10.0 + READ_DN * READ_DN).sqrt() as f32;
            (pixel.light + sd * n).round().clamp(0.0, 1023.0) as u16
        };
        self.image(self.pixels.iter().zip(noise).map(number).collect())
    }

    fn image(&self, words: Vec<u16>) -> Frame {
        let camera = &self.set.unit.sensor.camera;
        Frame { width: camera.width, height: camera.height, raw: words }
    }
}

fn pixel(set: &Set, site: &Site, plan: &Plan, rounding: f64) -> Pixel {
    let sum = Sum::of(&set.causes, site, plan);
    let base = set.unit.sigma(site.z, site.theta);
    let lit = site.facing / site.point.norm_squared();
    Pixel {
        disparity: (site.disparity + sum.error) as f32,
        // The calibrated sigma already includes the rounding of the stored number.
        sigma: (sum.stretch(site) * (base * base - rounding).max(0.0).sqrt()) as f32,
        gain: sum.gain as f32,
        loss: (1.0 - sum.answer) as f32,
        on_board: site.on_board,
        light: (site.albedo * (DN_AT_1_M * lit + DN_A_LUX * plan.lux)) as f32,
    }
}
