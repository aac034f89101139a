//! Infers the unit of depth images from their raw values: whether it can be the assumed one and,
//! without a description, what it is.

use super::images::read_any;
use crate::frame::{DepthCode, KINECT_NO_MEASUREMENT};
use crate::sensors::OPENKINECT;
use crate::stats::{median, quantile};
use crate::units::{decimals, shortest};
use crate::view::FrameRef;

/// Frames examined, spread over all.
const MAX_FRAMES: usize = 12;
/// Value that some sensors write for "no measurement", besides 0 (7-Scenes).
const ALL_ONES: usize = u16::MAX as usize;
const NO_DISPARITY: usize = KINECT_NO_MEASUREMENT as usize;
/// OpenKinect's formula has its pole at 1084.6: a Kinect v1 sends nothing above this value but 2047.
const MAX_DISPARITY: usize = 1092;
/// Smallest share of pixels with 2047 in raw disparities. The matching window alone leaves 8 of a Kinect's
/// 640 columns (1.2 %) without a disparity; in depths, 2047 is one value among thousands.
const MIN_SHARE_WITHOUT: f64 = 0.001;
/// Largest share of depth values above the limit: readout glitches, which no real recording at hand has.
const MAX_STRAY_SHARE: f64 = 1e-4;

/// Step of a Kinect v1's disparity in inverse depth, 1/m: z steps of 2.86e-3 z^2, measured on the 39 views of
/// Herrera, Kannala and Heikkila (2012).
const KINECT_STEP: f64 = 2.86e-3;
/// Usual units per metre: OpenNI and ROS; TUM.
const USUAL_UNITS: [f64; 2] = [1000.0, 5000.0];
/// Tolerance on a usual unit. The four real recordings in such units at hand (7-Scenes, TUM
/// freiburg1, MIT tabletop, JSK) give 0.98 to 0.99 of theirs; a stereo camera's 1/32 px in
/// millimetres gives 5600, 1.12 of TUM's.
const SAME_UNIT: f64 = 0.1;
/// Steps of fewer units than this are mostly rounding.
const MIN_STEP: usize = 4;
/// Fewest steps for a credible lattice, and their largest interquartile range relative to the median: 0.04 to
/// 0.11 in those four. A synthetic scene without steps (ICL-NUIM) has 33 such gaps.
const MIN_STEPS: usize = 40;
const MAX_SPREAD: f64 = 0.15;
/// No sensor that covers a room measures nearer than this, m (a Kinect from 0.4 m).
const NEAREST_M: f64 = 0.3;
/// Farthest range of structured light and time of flight of this class, m.
const FARTHEST_M: f64 = 12.0;

/// Histogram of the raw values in some of a recording's frames.
pub(super) struct RawValues {
    counts: Vec<u64>,
    /// Median value of each frame that has any depth.
    medians: Vec<f64>,
}

impl RawValues {
    /// Unreadable frames are skipped: their reader reports why.
    pub fn of<'f>(frames: impl ExactSizeIterator<Item = &'f FrameRef>) -> Self {
        let stride = frames.len().div_ceil(MAX_FRAMES).max(1);
        let mut values = RawValues { counts: vec![0; 1 + ALL_ONES], medians: Vec::new() };
        for frame in frames.step_by(stride) {
            let Ok(frame) = read_any(frame) else { continue };
            frame.raw.iter().for_each(|&raw| values.counts[usize::from(raw)] += 1);
            let is_depth = |raw: &u16| !matches!(usize::from(*raw), 0 | NO_DISPARITY | ALL_ONES);
            let mut depths: Vec<f64> =
                frame.raw.into_iter().filter(is_depth).map(f64::from).collect();
            if !depths.is_empty() {
                values.medians.push(median(&mut depths));
            }
        }
        values
    }

    fn count(&self, range: std::ops::RangeInclusive<usize>) -> u64 {
        self.counts[range].iter().sum()
    }

    /// Number of values that may be a depth in some code.
    fn depths(&self) -> u64 {
        self.count(1..=ALL_ONES - 1) - self.counts[NO_DISPARITY]
    }

    /// Smallest and largest value that may be a depth.
    fn ends(&self) -> Option<[usize; 2]> {
        let mut occurring = (1..ALL_ONES).filter(|&v| v != NO_DISPARITY && self.counts[v] > 0);
        let first = occurring.next()?;
        Some([first, occurring.next_back().unwrap_or(first)])
    }

    fn share_of_stray(&self, beyond: usize) -> f64 {
        let stray = self.count(beyond + 1..=ALL_ONES - 1);
        let code = if beyond < NO_DISPARITY { self.counts[NO_DISPARITY] } else { 0 };
        (stray - code) as f64 / self.depths().max(1) as f64
    }

    /// Whether these are the 11-bit values of a Kinect v1: 2047 where there is no measurement, and otherwise
    /// nothing above the largest value that has a depth.
    fn are_disparities(&self) -> bool {
        let all: u64 = self.counts.iter().sum();
        let without = self.counts[NO_DISPARITY] as f64 / all.max(1) as f64;
        self.depths() > 0
            && without > MIN_SHARE_WITHOUT
            && self.share_of_stray(MAX_DISPARITY) < MAX_STRAY_SHARE
    }

    /// Units per metre if these are a Kinect's disparity steps: inverse depths [`KINECT_STEP`] apart.
    fn kinect_units(&self) -> Option<f64> {
        let occurring: Vec<usize> =
            (1..ALL_ONES).filter(|&v| v != NO_DISPARITY && self.counts[v] > 0).collect();
        let steps = occurring.windows(2).filter(|w| w[1] - w[0] >= MIN_STEP);
        let mut inverse: Vec<f64> = steps.map(|w| 1.0 / w[0] as f64 - 1.0 / w[1] as f64).collect();
        if inverse.len() < MIN_STEPS {
            return None;
        }
        let mut at = |share: f64| quantile(&mut inverse, share);
        let (low, middle, high) = (at(0.25)?, at(0.5)?, at(0.75)?);
        (high - low < MAX_SPREAD * middle).then_some(KINECT_STEP / middle)
    }

    /// The usual unit that the steps indicate, of a sensor that may be a Kinect. Other sensors' steps in one unit look
    /// like a Kinect's in another.
    fn stepped_unit(&self, may_be_kinect: bool) -> Option<f64> {
        let units = self.kinect_units().filter(|_| may_be_kinect)?;
        USUAL_UNITS.into_iter().find(|usual| (units / usual - 1.0).abs() < SAME_UNIT)
    }

    /// The only code that explains the values, and why; or what they leave open.
    pub fn code(&self, may_be_kinect: bool) -> Result<(DepthCode, String), String> {
        let metric = |units_per_metre| DepthCode::Metric { units_per_metre, invalid: 0 };
        if self.are_disparities() {
            let why = "2047 marks missing pixels and no depth is above 1092: raw Kinect disparities, \
                       by OpenKinect's formula (3.33095,-0.0030711)";
            return Ok((OPENKINECT, why.into()));
        }
        let Some([first, last]) = self.ends() else {
            return Err("no image shows a depth, so that nothing tells its unit".into());
        };
        if let Some(units) = self.stepped_unit(may_be_kinect) {
            let named = if units == USUAL_UNITS[0] { "millimetres" } else { "5000 a metre" };
            let why = format!("depth steps as a Kinect's does in {named}: taken as that");
            return Ok((metric(units), why));
        }
        let [mm, tum] = USUAL_UNITS;
        let [near, far] = ends_of(&self.medians);
        // If all values are below the pole, they may be disparities without a missing pixel.
        let only_mm = near / tum < NEAREST_M && near / mm >= NEAREST_M && far / mm <= FARTHEST_M;
        if only_mm && last > MAX_DISPARITY {
            let why = format!(
                "depth taken as millimetres ({:.2} to {:.2} m; at 5000 a metre the nearest image would lie at {:.2} m)",
                first as f64 / mm,
                last as f64 / mm,
                near / tum
            );
            return Ok((metric(mm), why));
        }
        let [first, last] = [first, last].map(|v| v as f64);
        let mut readings = format!(
            "{:.2} to {:.2} m in millimetres, {:.2} to {:.2} m at 5000 a metre",
            first / mm,
            last / mm,
            first / tum,
            last / tum
        );
        if last <= MAX_DISPARITY as f64 {
            readings += ", or a Kinect's raw disparities";
        }
        Err(format!(
            "these images do not say how raw values become metres, and these ({first} to {last}) leave it open: {readings}"
        ))
    }

    /// Why these values cannot be in `code`, and what to do.
    pub fn contradiction(&self, code: DepthCode) -> Option<(String, &'static str)> {
        match code {
            DepthCode::Metric { invalid, .. } if invalid != KINECT_NO_MEASUREMENT => {
                let [_, last] = self.ends()?;
                let all: u64 = self.counts.iter().sum();
                let share = 1e2 * self.counts[NO_DISPARITY] as f64 / all as f64;
                self.are_disparities().then(|| {
                    let what = format!(
                        "read as lengths, but {share:.1} % of the pixels hold 2047 and none of the others is above {last}: these are raw disparities of a Kinect v1"
                    );
                    let remedy = "give --raw-disparity (3.33095,-0.0030711 is OpenKinect's), or raw_disparity in recording.json in place of units_per_metre";
                    (what, remedy)
                })
            }
            DepthCode::Disparity { invalid: KINECT_NO_MEASUREMENT, .. } => {
                let [_, last] = self.ends()?;
                (self.share_of_stray(NO_DISPARITY) > MAX_STRAY_SHARE).then(|| {
                    let what = format!(
                        "read as raw disparities, which have 11 bits, but values up to {last} occur: these are lengths"
                    );
                    let remedy = "give --units-per-metre (1000 = mm, 5000 = TUM), or units_per_metre in recording.json in place of raw_disparity";
                    (what, remedy)
                })
            }
            _ => None,
        }
    }

    /// Why these values are probably not in `code`.
    pub fn doubt(&self, code: DepthCode, may_be_kinect: bool) -> Option<String> {
        let DepthCode::Metric { units_per_metre: given, .. } = code else { return None };
        // A unit a few percent off is a scale error, which a diagnosis identifies.
        let stepped = self.stepped_unit(may_be_kinect);
        let other = stepped.filter(|unit| !(0.5..2.0).contains(&(unit / given)));
        let shown = shortest(given);
        if let Some(unit) = other {
            return Some(format!(
                "depth is read at {shown} units a metre, but steps as a Kinect's does at {unit}: check --units-per-metre, or units_per_metre in recording.json"
            ));
        }
        let [near, far] = ends_of(&self.medians).map(|raw| raw / given);
        let odd = near < NEAREST_M || far > FARTHEST_M;
        (odd && !self.medians.is_empty()).then(|| {
            let [near, far] = [near, far].map(|z| decimals(z, 2));
            format!(
                "at {shown} units a metre the images lie {near} to {far} m away, where a sensor of this kind sees {NEAREST_M} to {FARTHEST_M} m: check --units-per-metre, or units_per_metre in recording.json"
            )
        })
    }
}

fn ends_of(values: &[f64]) -> [f64; 2] {
    crate::stats::range(values.iter().copied())
}

#[cfg(test)]
#[path = "raw_values_tests.rs"]
mod tests;
