//! Values whose code is known.

use super::*;

/// Frames of a tilted wall at these distances, m, in a code; `stepped` as a Kinect's disparities are.
fn values(distances_m: &[f64], units: f64, stepped: bool) -> RawValues {
    let mut values = RawValues { counts: vec![0; 1 + ALL_ONES], medians: Vec::new() };
    for &z in distances_m {
        let tilted = (0..20_000).map(|i| z * (1.0 + 0.3 * (f64::from(i) / 20_000.0 - 0.5)));
        let on_lattice = |z: f64| KINECT_STEP * (1.0 / z / KINECT_STEP).round();
        let seen = tilted.map(|z| if stepped { 1.0 / on_lattice(z) } else { z });
        let raw: Vec<usize> = seen.map(|z| (z * units).round() as usize).collect();
        raw.iter().for_each(|&v| values.counts[v] += 1);
        values.medians.push(median(&mut raw.iter().map(|&v| v as f64).collect::<Vec<_>>()));
    }
    values
}

fn units(values: &RawValues) -> Option<f64> {
    match values.code(true).ok()?.0 {
        DepthCode::Metric { units_per_metre, .. } => Some(units_per_metre),
        DepthCode::Disparity { .. } => None,
    }
}

#[test]
fn the_steps_of_a_kinect_tell_its_unit() {
    for unit in USUAL_UNITS {
        let seen = values(&[1.6, 2.0, 2.7, 3.5], unit, true);
        assert_eq!(units(&seen), Some(unit), "{:?}", seen.kinect_units());
        let other = if unit == 1000.0 { 5000.0 } else { 1000.0 };
        let code = |units_per_metre| DepthCode::Metric { units_per_metre, invalid: 0 };
        assert!(seen.doubt(code(other), true).is_some_and(|d| d.contains("steps as a Kinect's")));
        assert_eq!(seen.doubt(code(unit), true), None);
        assert_eq!(seen.doubt(code(1.035 * unit), true), None, "a scale");
    }
}

/// The 1/32 px steps of a stereo camera with a baseline of 0.095 m and f = 640 px are not a Kinect's.
#[test]
fn another_lattice_decides_nothing() {
    let mut seen = values(&[2.0, 3.0, 4.0, 6.0], 1000.0, true);
    assert_eq!(seen.stepped_unit(true), Some(1000.0));
    seen = values(&[4.0, 6.0, 8.0], 1000.0 * 5.58, true);
    assert_eq!(seen.stepped_unit(true), None, "{:?}", seen.kinect_units());
    // A D415's, of 1/32 px with 0.055 m and 1004.6 px, are like a Kinect's at 5000 a metre.
    seen = values(&[2.0, 3.0, 4.0, 6.0], 5000.0, true);
    assert_eq!(seen.stepped_unit(false), None);
    assert!(seen.code(false).is_err());
}

#[test]
fn range_tells_millimetres_and_nothing_else() {
    assert_eq!(units(&values(&[1.0, 2.0, 4.0], 1000.0, false)), Some(1000.0));
    let open = values(&[2.0, 4.0], 1000.0, false).code(true).unwrap_err();
    assert!(open.contains("1.70 to 4.60 m in millimetres, 0.34 to 0.92 m at 5000"), "{open}");
    assert!(values(&[1.0, 2.0], 5000.0, false).code(true).is_err());
    let low = values(&[0.6, 0.7], 1000.0, false).code(true).unwrap_err();
    assert!(low.contains("raw disparities"), "{low}");
}

#[test]
fn the_code_2047_tells_disparities() {
    let mut seen = values(&[0.5, 0.7, 0.9], 1000.0, false);
    let lengths = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };
    assert!(seen.contradiction(lengths).is_none());
    assert!(seen.contradiction(OPENKINECT).is_none());
    seen.counts[NO_DISPARITY] = 2000;
    assert_eq!(seen.code(true).map(|c| c.0), Ok(OPENKINECT));
    let (what, remedy) = seen.contradiction(lengths).unwrap();
    assert!(what.contains("2047") && remedy.contains("--raw-disparity"), "{what}");
    // A value above the pole is a depth in millimetres, and then so is 2047.
    seen.counts[1800] = 500;
    assert!(seen.contradiction(lengths).is_none());
    seen.counts[3000] = 500;
    assert!(seen.contradiction(OPENKINECT).unwrap().0.contains("up to 3000"));
}
