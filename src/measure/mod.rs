//! Measures the plane and the sigma of a view, cell by cell, from its frames.
//!
//! The first few frames give the target and the scale; all stream through accumulators.

mod binned;
mod budget;
mod cells;
mod column_steps;
mod doubtful;
mod finish;
mod follow;
mod frames;
mod grouping;
mod mean;
mod scan;
mod table;
mod view;

pub use budget::flatness_uncertainty_m;
pub use cells::{Cell, Spread};
pub use column_steps::ColumnSteps;
pub use frames::{LeftOut, TargetFrames, view_target};
pub(crate) use grouping::words_a_step;
pub use table::{SigmaKind, SigmaRow, SigmaTable, read_table, write_measurements};
pub use view::{measure_view, ranges_remark, without_copies};

use crate::camera::Rays;
use crate::frame::{DepthCode, DepthTable};
use crate::plane::{Exclusions, Plane, RansacPlane};
use crate::rng::Seed;
use crate::stats::{Budget, Correlation};
use crate::view::Sensor;

#[derive(Debug, Clone, Copy)]
pub struct MeasureOptions {
    /// The paper's RANSAC threshold, m; by default three robust standard deviations of the view.
    pub ransac_threshold_m: Option<f64>,
    /// Largest number of hypotheses that the paper's RANSAC tries.
    pub ransac_iterations: usize,
    pub seed: Seed,
}

impl Default for MeasureOptions {
    fn default() -> Self {
        MeasureOptions { ransac_threshold_m: None, ransac_iterations: 500, seed: Seed(0) }
    }
}

/// Largest step of a sensor between raw words, 1/m: twice an eighth of a pixel of a Kinect, whose disparity
/// is 43.5 px at 1 m.
const COARSEST_STEP: f64 = 2.0 * 0.125 / 43.5;

/// Data shared by all views of a recording, computed once.
#[derive(Debug)]
pub struct Workbench<'a> {
    pub sensor: &'a Sensor,
    pub rays: Rays,
    /// From raw value to m.
    pub table: DepthTable,
    pub options: MeasureOptions,
    /// Share of the range's excess over the depth that raw values contain: 1 where they are ranges.
    pub ray_share: f64,
}

impl<'a> Workbench<'a> {
    pub fn new(sensor: &'a Sensor, options: MeasureOptions) -> Self {
        Workbench {
            sensor,
            rays: sensor.camera.rays(),
            table: sensor.code.table(),
            options,
            ray_share: 0.0,
        }
    }

    fn step(&self, words: f64, w: f64) -> f64 {
        sensor_step(&self.sensor.code, words, w)
    }
}

/// Step of `words` raw words of the depth code at inverse depth `w`, 1/m.
pub(crate) fn sensor_step(code: &DepthCode, words: f64, w: f64) -> f64 {
    let one = if w > 0.0 { code.step_inverse(1.0 / w) } else { 0.0 };
    one.max(f64::min(words * one, COARSEST_STEP))
}

/// All measurements of one view.
#[derive(Debug, Clone)]
pub struct ViewMeasurement {
    pub name: String,
    /// Seconds on the recording's clock, first frame.
    pub time_s: f64,
    pub plane: Plane,
    /// Mean depth of the target's pixels, m.
    pub z_m: f64,
    /// Angle between the optical axis and the plane's normal, rad.
    pub theta_rad: f64,
    /// Image direction in which depth grows, rad; 0 along the columns.
    pub azimuth_rad: f64,
    pub whole: Cell,
    /// The target divided into bins of depth; one bin when it is not strongly tilted.
    pub cells: Vec<Cell>,
    pub paper: Option<RansacPlane>,
    /// Correlation between the residuals of neighbouring pixels.
    pub correlation: Correlation,
    /// Correlation of a pixel with itself one frame later; `None` with fewer than 4 frames.
    pub temporal_correlation: Option<f64>,
    pub frames: usize,
    /// Pixels left out, by reason.
    pub exclusions: Exclusions,
    /// From `view.json`, m.
    pub reference_distance_m: Option<f64>,
    /// Depth of the plane on the optical axis, m: what a reference distance is compared with.
    pub axis_distance_m: f64,
    /// Its standard error, from the scatter of the readings, m.
    pub axis_std_error_m: f64,
    /// Disparity in px times depth in m; `None` where the sensor has no disparity.
    pub disparity_px_m: Option<f64>,
    /// Standard uncertainty of the reference, from `view.json`, m.
    pub reference_uncertainty_m: Option<f64>,
    /// Budget of [`ReferenceDistance::off_m`], where the uncertainty of the reference is stated.
    pub distance_budget: Option<Budget>,
    /// Mean infrared amplitude of the target, in the image's own units.
    pub infrared: Option<f64>,
    /// Picture of the mean residual.
    pub picture: ResidualPicture,
    pub notes: Vec<String>,
    /// SHA-256 of the frames' bytes in order.
    pub digest: [u8; 32],
}

impl ViewMeasurement {
    /// The spatial sigma of a cell in px of disparity: the noise of the matcher.
    pub fn sigma_px(&self, cell: &Cell) -> Option<f64> {
        self.disparity_px_m.map(|px_m| cell.spread.spatial_m * px_m / cell.z_m.powi(2))
    }

    /// The measured distance on the optical axis with the one in `view.json`, if it gives one.
    pub fn reference(&self) -> Option<ReferenceDistance> {
        self.reference_distance_m
            .map(|reference_m| ReferenceDistance { reference_m, measured_m: self.axis_distance_m })
    }
}

/// The view's mean residual, downsampled for display; NaN outside the target.
#[derive(Debug, Clone)]
pub struct ResidualPicture {
    pub width: usize,
    pub height: usize,
    pub millimetres: Vec<f32>,
}

/// Depth of the target's plane on the optical axis, as measured and by the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceDistance {
    /// From `view.json`, m.
    pub reference_m: f64,
    /// From the fitted plane, m.
    pub measured_m: f64,
}

/// Error of a tape held to a case whose optical centre is not marked, m.
const TAPE_M: f64 = 0.005;
/// Share of the distance: twice the largest difference, 0.46 %, in the 30 views of a calibrated Kinect v1
/// with known distances (Herrera, Kannala and Heikkila 2012).
const SCALE_SHARE: f64 = 0.01;

impl ReferenceDistance {
    /// Measured minus reference, m: positive where the sensor sees the target too far away.
    pub fn off_m(&self) -> f64 {
        self.measured_m - self.reference_m
    }

    /// Largest plausible difference of the two, m.
    pub fn tolerance_m(&self) -> f64 {
        TAPE_M + SCALE_SHARE * self.reference_m
    }

    /// Whether the two differ by more than the tolerance.
    pub fn contradicts(&self) -> bool {
        self.off_m().abs() > self.tolerance_m()
    }

    pub fn describe_tolerance() -> String {
        format!("{:.0} mm and {:.0} % of the distance", 1e3 * TAPE_M, 1e2 * SCALE_SHARE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tape_may_be_off_by_a_little_on_either_side() {
        let off = |measured_m| ReferenceDistance { reference_m: 2.0, measured_m }.contradicts();
        assert!(!off(2.024) && !off(1.976));
        assert!(off(2.026) && off(1.974));
    }
}
