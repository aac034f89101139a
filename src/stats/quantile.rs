//! Quantiles of a sample.

/// The `p`-quantile, 0 to 1, by interpolation between the sorted values (Hyndman and Fan's type 7);
/// `None` of nothing. Sorts `values`, which hold no NaN.
pub fn quantile(values: &mut [f64], p: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let at = p * (values.len().checked_sub(1)?) as f64;
    let (i, rest) = (at.floor() as usize, at.fract());
    let next = values.get(i + 1).unwrap_or(&values[i]);
    Some(values[i] + rest * (next - values[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: value p (n - 1), counted from 0, of the sorted five.
    #[test]
    fn quantiles_lie_between_the_sorted_values() {
        let mut values = [7.0, 1.0, 4.0, 2.0, 11.0];
        for (p, expected) in
            [(0.0, 1.0), (0.1, 1.4), (0.25, 2.0), (0.5, 4.0), (0.9, 9.4), (1.0, 11.0)]
        {
            approx::assert_relative_eq!(
                quantile(&mut values, p).unwrap(),
                expected,
                epsilon = 1e-12
            );
        }
        assert_eq!(values, [1.0, 2.0, 4.0, 7.0, 11.0], "sorted");
        assert_eq!(quantile(&mut [3.0], 0.7), Some(3.0));
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    /// The middle is the median, of even and odd numbers.
    #[test]
    fn the_half_is_the_median() {
        for n in 1..20 {
            let mut values: Vec<f64> = (0..n).map(|i| f64::from(i * 7 % 20).sin()).collect();
            let median = crate::stats::median(&mut values.clone());
            approx::assert_relative_eq!(
                quantile(&mut values, 0.5).unwrap(),
                median,
                epsilon = 1e-15
            );
        }
    }
}
