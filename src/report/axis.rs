//! An axis with round ticks, linear or logarithmic.

/// The range from `low` to `high`, with its labelled ticks.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The left or lower end.
    pub low: f64,
    /// The right or upper end.
    pub high: f64,
    /// Logarithmic, not linear.
    pub log: bool,
    /// Values with a tick and a label, ascending.
    pub ticks: Vec<f64>,
}

/// Most ticks of an axis; more crowd a figure.
const MAX_TICKS: usize = 10;
/// Fewest ticks that make a logarithmic axis readable.
const MIN_LOG_TICKS: usize = 4;
/// Share of the value by which an empty range is widened on each side.
const WIDEN: f64 = 0.05;
/// Mantissas of ticks.
const ROUND: [f64; 3] = [1.0, 2.0, 5.0];
/// Mantissas for a short logarithmic axis: more of them, evenly spread.
const FINER: [f64; 6] = [1.0, 1.5, 2.0, 3.0, 5.0, 7.0];

impl Axis {
    /// Linear axis with ticks at multiples of 1, 2 or 5 times a power of ten.
    pub fn linear(low: f64, high: f64) -> Self {
        let [low, high] = widened(low, high);
        Axis { low, high, log: false, ticks: multiples(low, high) }
    }

    /// Logarithmic axis with ticks at 1, 2 and 5 times powers of ten; both ends must be positive.
    pub fn log(low: f64, high: f64) -> Self {
        let [low, high] = widened(low.max(f64::MIN_POSITIVE), high);
        let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let inside = |mantissas: &[f64]| -> Vec<f64> {
            decades
                .clone()
                .flat_map(|k| mantissas.iter().map(move |m| m * 10f64.powi(k)))
                .filter(|v| (low..=high).contains(v))
                .collect()
        };
        let mut ticks = inside(&ROUND);
        if ticks.len() > MAX_TICKS {
            ticks = inside(&ROUND[..1]);
        } else if ticks.len() < MIN_LOG_TICKS {
            ticks = inside(&FINER);
        }
        if ticks.len() < MIN_LOG_TICKS {
            ticks = multiples(low, high);
        }
        Axis { low, high, log: true, ticks }
    }

    /// Linear axis with `share` of the range added at each end, so that no mark touches the frame.
    pub fn with_margin([low, high]: [f64; 2], share: f64) -> Self {
        let spare = share * (high - low);
        Axis::linear(low - spare, high + spare)
    }

    /// Drops every other tick where there are many, for a small chart.
    pub fn sparse(mut self) -> Self {
        if self.ticks.len() > MAX_TICKS / 2 + 1 {
            let step = self.ticks[1] - self.ticks[0];
            self.ticks.retain(|t| ((t / step).round() as i64) % 2 == 0);
        }
        self
    }

    /// Drops the ticks below `value`.
    pub fn ticks_from(mut self, value: f64) -> Self {
        self.ticks.retain(|t| *t >= value);
        self
    }

    /// Position of `value`: 0 at the low end, 1 at the high end.
    pub fn share(&self, value: f64) -> f64 {
        if self.log {
            (value / self.low).ln() / (self.high / self.low).ln()
        } else {
            (value - self.low) / (self.high - self.low)
        }
    }

    /// Whether `value` lies on the axis.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }

    /// Label of a tick, without needless digits.
    pub fn label(value: f64) -> String {
        const DIGITS: f64 = 1e9;
        format!("{}", (value * DIGITS).round() / DIGITS + 0.0).replace('-', "−")
    }
}

/// Smallest of 1, 2 or 5 times a power of ten that is not below `value`.
pub(super) fn round_up(value: f64) -> f64 {
    const ROUNDING: f64 = 1e-9;
    let decade = 10f64.powf(value.log10().floor());
    let mantissa = value / decade * (1.0 - ROUNDING);
    ROUND.into_iter().find(|m| *m >= mantissa).unwrap_or(10.0) * decade
}

fn widened(low: f64, high: f64) -> [f64; 2] {
    if high - low > f64::EPSILON * low.abs().max(high.abs()) {
        return [low, high];
    }
    let by = if low == 0.0 { 1.0 } else { WIDEN * low.abs() };
    [low - by, low + by]
}

fn multiples(low: f64, high: f64) -> Vec<f64> {
    let step = round_up((high - low) / MAX_TICKS as f64);
    let first = (low / step - f64::EPSILON).ceil() as i64;
    (first..)
        .map(|k| k as f64 * step)
        .take_while(|v| *v <= high * (1.0 + f64::EPSILON) + f64::EPSILON)
        .take(2 * MAX_TICKS)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers_are_one_two_or_five() {
        let values = [0.7, 1.0, 1.01, 2.0, 3.0, 5.1, 0.013, 470.0];
        let round = [1.0, 1.0, 2.0, 2.0, 5.0, 10.0, 0.02, 500.0];
        for (value, up) in values.into_iter().zip(round) {
            approx::assert_relative_eq!(round_up(value), up, max_relative = 1e-12);
        }
    }

    #[test]
    fn ticks_are_inside_finite_and_few() {
        for (low, high) in [(0.0, 0.0), (1.0, 1.0), (0.0, 76.0), (1.3, 1.31), (0.5, 900.0)] {
            for axis in [Axis::linear(low, high), Axis::log(low.max(1e-3), high.max(1e-3))] {
                assert!(axis.low.is_finite() && axis.high > axis.low, "{axis:?}");
                assert!((2..=11).contains(&axis.ticks.len()), "{axis:?}");
                for t in &axis.ticks {
                    assert!((-1e-9..=1.0 + 1e-9).contains(&axis.share(*t)), "{axis:?}");
                }
            }
        }
    }

    #[test]
    fn labels_have_no_needless_digits() {
        let labels = [0.1 + 0.2, 5.0, 20.0, 0.005].map(Axis::label);
        assert_eq!(labels, ["0.3", "5", "20", "0.005"]);
    }
}
