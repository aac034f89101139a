//! Formats numbers as text, the same way everywhere: short, never a page of digits.

/// From here on (and below its inverse) an exponent is shorter than zeros; an `f64` no longer resolves
/// units beyond 2^53 = 9e15.
const MANY_DIGITS: f64 = 1e15;

/// The shortest text that parses back to the same number, with an exponent where it would be long.
///
/// ```
/// use kinoise::units::shortest;
/// assert_eq!(shortest(0.1), "0.1");
/// assert_eq!(shortest(-1e300), "-1e300");
/// ```
pub fn shortest(v: f64) -> String {
    if is_long(v) { format!("{v:e}") } else { format!("{v}") }
}

/// Rounds to `digits` significant digits, for calculated values that carry no more information.
///
/// ```
/// use kinoise::units::to_digits;
/// assert_eq!(to_digits(0.1 * 0.8, 4), 0.08);
/// ```
pub fn to_digits(v: f64, digits: usize) -> f64 {
    format!("{v:.*e}", digits.saturating_sub(1)).parse().unwrap_or(v)
}

/// Formats with this many decimals, or with three digits and an exponent where the number is huge.
///
/// ```
/// use kinoise::units::decimals;
/// assert_eq!(decimals(2.345, 1), "2.3");
/// assert_eq!(decimals(1e300, 1), "1.00e300");
/// ```
pub fn decimals(v: f64, decimals: usize) -> String {
    if is_long(v) && v.abs() > 1.0 { format!("{v:.2e}") } else { format!("{v:.decimals$}") }
}

/// `1 view`, `2 views`.
///
/// ```
/// use kinoise::units::counted;
/// assert_eq!([counted(1, "view"), counted(0, "view")], ["1 view", "0 views"]);
/// ```
pub fn counted(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// Singular or plural of a verb, by the count `n`.
///
/// ```
/// use kinoise::units::verb;
/// assert_eq!([verb(1, "lies", "lie"), verb(2, "lies", "lie")], ["lies", "lie"]);
/// ```
pub fn verb<'a>(n: usize, one: &'a str, more: &'a str) -> &'a str {
    if n == 1 { one } else { more }
}

fn is_long(v: f64) -> bool {
    v.is_finite() && v != 0.0 && !(1.0 / MANY_DIGITS..MANY_DIGITS).contains(&v.abs())
}
