//! Corrections by single shapes and formulas.

use super::*;

#[test]
fn a_shape_is_its_closed_form_at_chosen_pixels() {
    let plane = Plane::tilted(1.2, 0.6, 0.4);
    let camera = sensor().camera;
    let shape = vec![
        bias(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(2.0)), &[0.8, -0.3]),
        // Coefficients in units of 0.2 px.
        bias(Basis::waves(Coordinate::Column, 40.0, 1), &[1.0, -0.5]),
        bias(
            Basis::powers(
                Coordinate::RaySquared,
                1,
                Modulation::RadialSlope { fx: camera.fx, fy: camera.fy },
            ),
            &[-0.05],
        ),
        bias(
            Basis::Curve {
                over: Coordinate::LogZ,
                low: 0.0,
                high: 1.0,
                nodes: 3,
                times: Modulation::Tilt,
            },
            &[0.1, 0.5, 0.3],
        ),
    ];
    let shot = &shots(plane, &[shaped(UNEXPLAINED, shape)], SILENT_M, &[0.0])[0];
    let found = residuals(&depths(shot), &plane);
    for (u, v) in CHOSEN {
        let (x, y) = ((u as f64 - camera.cx) / camera.fx, (v as f64 - camera.cy) / camera.fy);
        let z = plane.depth(x, y);
        let d = FB / z;
        let r2 = ((u as f64 - 159.5).powi(2) + (v as f64 - 119.5).powi(2))
            / (159.5f64.powi(2) + 119.5f64.powi(2));
        let bowl = (d / 40.0).powi(2) * (0.8 * r2 - 0.3 * r2 * r2);
        let phase = std::f64::consts::TAU * u as f64 / 40.0;
        let banding = 0.2 * phase.sin() - 0.1 * phase.cos();
        // k1 moves a ray by k1 r^2 along the radius: the disparity changes by the plane's gradient.
        let gradient = FB * (plane.q.x * x + plane.q.y * y);
        let lens = -gradient * (x * x + y * y) * -0.05;
        let knot = z.ln().clamp(0.0, 1.0) * 2.0;
        let line = if knot < 1.0 { 0.1 + 0.4 * knot } else { 0.5 - 0.2 * (knot - 1.0) };
        let expected = bowl + banding + lens + line * 0.6f64.sin();
        let off = found[v * 320 + u] - expected;
        assert!(off.abs() < rounding_px(z), "{u} {v}: {off} of {expected}");
    }
}

/// A bow and edge mixing belong to the board: the wall behind it has neither.
#[test]
fn a_boards_shape_stays_on_the_board() {
    let plane = Plane::tilted(1.0, 0.0, 0.0);
    let mut bench = Bench::bare(plane, common::BOARD);
    bench.wall_m = Some(2.0);
    let shape = vec![
        bias(Basis::relief(2), &[0.05, 0.0, 0.0]),
        bias(Basis::Decay { over: Coordinate::Edge, width: 3.0 }, &[-0.5]),
    ];
    let shot = &shots_of(&bench, &[shaped("target-bow", shape)], SILENT_M, &[0.0])[0];
    let depth = depths(shot);
    let found = residuals(&depth, &plane);
    let camera = sensor().camera;
    // The board reaches from column 14.5 to 304.5 and from row 3.5 to 235.5.
    for (u, v) in [(160, 120), (60, 60), (20, 120), (304, 120), (100, 235)] {
        let right = (u as f64 - camera.cx) / camera.fx;
        let edge = (u - 14).min(305 - u).min(v - 3).min(236 - v) as f64;
        let expected = 0.05 * FB * right * right - 0.5 * (-edge / 3.0).exp();
        let off = found[v * 320 + u] - expected;
        assert!(off.abs() < rounding_px(1.0), "{u} {v}: {off} of {expected}");
    }
    assert!((depth[120 * 320 + 5] - 2.0).abs() < 1e-4, "the wall");
}

#[test]
fn a_shape_over_the_session_moves_with_it_and_the_rest_stands() {
    let plane = Plane::tilted(1.0, 0.0, 0.0);
    let curve =
        |over, high| Basis::Curve { over, low: 0.0, high, nodes: 2, times: Modulation::One };
    let shape = vec![
        bias(curve(Coordinate::Session, 100.0), &[0.0, 1.0]),
        bias(curve(Coordinate::Column, 319.0), &[0.0, 0.5]),
    ];
    let sessions = [0.0, 25.0, 100.0, 400.0];
    let frames = shots(plane, &[shaped("thermal-drift", shape)], SILENT_M, &sessions);
    for (frame, expected) in frames.iter().zip([0.0, 0.25, 1.0, 1.0]) {
        let found = residuals(&depths(frame), &plane);
        for u in [0, 100, 319] {
            let off = found[120 * 320 + u] - expected - 0.5 * u as f64 / 319.0;
            assert!(off.abs() < rounding_px(1.0), "{expected}: {off}");
        }
    }
}

/// A variance term of value v scales the standard deviation by exp(v / 2).
#[test]
fn a_variance_shape_scales_the_noise() {
    let plane = Plane::tilted(1.0, 0.0, 0.0);
    let level = term(Statistic::Variance, Basis::Level, &[1.2]);
    let spread = |effects: &[Effect]| {
        rms(&residuals(&depths(&shots(plane, effects, 0.003, &[0.0])[0]), &plane))
    };
    let ratio = spread(&[shaped("vignetting", vec![level])]) / spread(&[]);
    assert!((ratio / 0.6f64.exp() - 1.0).abs() < 0.01, "{ratio}");
}

/// The same effect by formula and as a hand-written shape gives the same image.
#[test]
fn a_bowl_by_shape_is_the_bowl_by_formula() {
    let plane = Plane::tilted(1.5, 0.5, 1.0);
    let bowl = bias(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), &[0.7]);
    let by_shape = shots(plane, &[shaped("radial-disparity-bias", vec![bowl])], 0.002, &[0.0]);
    let by_formula =
        shots(plane, &[named("radial-disparity-bias", json!({"k_px": 0.7}))], 0.002, &[0.0]);
    let apart = by_shape[0].raw.iter().zip(&by_formula[0].raw).map(|(a, b)| a.abs_diff(*b));
    assert!(apart.max().unwrap_or(0) <= 1);
}

/// Every invertible formula, alone and then all together, without noise and with it.
#[test]
fn what_a_formula_does_its_correction_undoes() {
    let entries = [
        named("depth-scale", json!({"scale": 1.04})),
        named("disparity-offset", json!({"offset_px": 0.4})),
        named("thermal-drift", json!({"relative": 0.02, "time_constant_s": 50.0})),
        named("range-not-depth", json!({"share": 1.0})),
        named("radial-disparity-bias", json!({"k_px": {"value": -0.8, "std_error": 0.1}})),
        named("lens-distortion", json!({"k1": -0.08})),
        named("pixel-locking", json!({"amplitude_px": 0.1})),
        named("column-banding", json!({"amplitude_px": 0.2, "period_px": 50.0})),
    ];
    let plane = Plane::tilted(1.1, 0.7, 0.3);
    let check = |effects: &[Effect], sigma_m: f64, limit_px: f64| {
        let frame = &shots(plane, effects, sigma_m, &[0.0, 70.0])[1];
        let correction =
            Correction::of(&model(&sensor(), effects.to_vec()), &sensor()).expect("one");
        let mut depth = depths(frame);
        let before = rms(&residuals(&depth, &plane));
        let conditions = Conditions { session_s: 70.0, ..Conditions::default() };
        correction.apply(&mut depth, &conditions).expect("applied");
        let after = rms(&residuals(&depth, &plane));
        let ids: Vec<&str> = effects.iter().map(|e| e.id.as_str()).collect();
        assert!(before > 0.03, "{ids:?} did nothing: {before}");
        assert!(after < limit_px, "{ids:?}: {before} -> {after} px, not below {limit_px}");
    };
    for entry in &entries {
        check(std::slice::from_ref(entry), SILENT_M, 0.008);
    }
    check(&entries, SILENT_M, 0.012);
    let noise = rms(&residuals(&depths(&shots(plane, &[], 0.004, &[0.0])[0]), &plane));
    // Scaling and locking change the noise a little too.
    check(&entries, 0.004, 1.15 * noise);
}

/// Each view has its own steps and they are estimated from it: steps of half a read-out step among 320
/// columns, beside noise of the same size.
#[test]
fn columns_that_step_differently_in_every_view_are_taken_out_of_each() {
    let parameters = json!({"amplitude_px": 0.03125, "period_px": 34.0, "spread": 2.5});
    let (plane, effects) = (Plane::tilted(0.8, 0.2, 0.3), [named("column-banding", parameters)]);
    let correction = Correction::of(&model(&sensor(), effects.to_vec()), &sensor()).expect("one");
    let noise = rms(&residuals(&depths(&shots(plane, &[], 0.001, &[0.0])[0]), &plane));
    for frame in shots(plane, &effects, 0.001, &[0.0, 1.0, 2.0]) {
        let mut depth = depths(&frame);
        let before = rms(&residuals(&depth, &plane));
        correction.apply(&mut depth, &Conditions::default()).expect("applied");
        let after = rms(&residuals(&depth, &plane));
        assert!(
            before > noise.hypot(0.015) && after < 1.03 * noise,
            "{noise}: {before} -> {after}"
        );
    }
    let [sharp, clean] = [&effects[..], &[]].map(|e| depths(&shots(plane, e, 0.001, &[0.0])[0]));
    let mut other = clean.clone();
    correction.apply(&mut other, &Conditions::default()).expect("applied");
    let moved =
        |a: &[f32], b: &[f32]| a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-6).count();
    assert_eq!(moved(&clean, &other), 0, "an image without steps stays");
    assert!(moved(&clean, &sharp) > 1000);
}

/// Each kind of sensor bias by hand; the surface that it needs is estimated from the noisy image.
#[test]
fn what_a_shape_does_its_correction_undoes() {
    let (camera, plane) = (sensor().camera, Plane::tilted(1.0, 0.8, -0.7));
    let curve =
        |over, [low, high]: [f64; 2], times| Basis::Curve { over, low, high, nodes: 3, times };
    let map =
        Basis::Map { width: 320.0, height: 240.0, across: 3, down: 2, times: Modulation::One };
    let pair = Basis::Pair {
        over: [Coordinate::Radius, Coordinate::Disparity],
        low: [0.0, 10.0],
        high: [1.0, 30.0],
        nodes: [2, 2],
    };
    let ring =
        Basis::Ring { over: Coordinate::Azimuth, period: 6.3, nodes: 4, times: Modulation::Tilt };
    let kinds = [
        bias(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(1.0)), &[2.0, -0.6]),
        bias(
            Basis::powers(
                Coordinate::RaySquared,
                2,
                Modulation::RadialSlope { fx: camera.fx, fy: camera.fy },
            ),
            &[-0.1, 0.05],
        ),
        bias(Basis::powers(Coordinate::Foreshortening, 1, Modulation::Disparity), &[1.0]),
        bias(curve(Coordinate::Z, [0.5, 4.0], Modulation::DisparitySquared), &[1.0, 2.0, -1.0]),
        bias(curve(Coordinate::Theta, [0.0, 1.5], Modulation::One), &[0.0, 0.6, 0.9]),
        bias(curve(Coordinate::Session, [0.0, 100.0], Modulation::Lift), &[0.0, 0.01, 0.02]),
        bias(map, &[0.1, -0.4, 0.6, 0.3, 0.2, -0.5]),
        bias(pair, &[0.5, -0.3, 0.8, 0.4]),
        bias(ring, &[0.4, -0.4, 0.8, 0.2]),
        bias(Basis::waves(Coordinate::Disparity, 3.0, 2), &[0.1, 0.05, 0.0, 0.02]),
    ];
    let quiet = rms(&residuals(&depths(&shots(plane, &[], 0.001, &[0.0])[0]), &plane));
    for kind in kinds {
        let effects = [shaped(UNEXPLAINED, vec![kind.clone()])];
        let frame = &shots(plane, &effects, 0.001, &[60.0])[0];
        let correction =
            Correction::of(&model(&sensor(), effects.to_vec()), &sensor()).expect("one");
        let mut depth = depths(frame);
        let before = rms(&residuals(&depth, &plane));
        let conditions = Conditions { session_s: 60.0, ..Conditions::default() };
        correction.apply(&mut depth, &conditions).expect("applied");
        let after = rms(&residuals(&depth, &plane));
        assert!(before > 1.2 * quiet, "{kind:?} did nothing: {before}, noise {quiet}");
        // A range read as a depth also stretches the noise, by 9 % here.
        assert!(after < 1.10 * quiet, "{kind:?}: {before} -> {after}, noise {quiet}");
    }
}

/// A board's shape, edge mixing and any variance are not a bias of the sensor.
#[test]
fn what_is_not_the_sensors_bias_stays_in_and_is_told() {
    let across = Basis::Pair {
        over: [Coordinate::Column, Coordinate::Right],
        low: [0.0, -1.0],
        high: [319.0, 1.0],
        nodes: [2, 2],
    };
    let effects = vec![
        shaped("target-bow", vec![bias(Basis::relief(2), &[0.01, 0.0, 0.0])]),
        shaped(
            "edge-mixing",
            vec![bias(Basis::Decay { over: Coordinate::Edge, width: 2.0 }, &[1.0])],
        ),
        shaped("vignetting", vec![term(Statistic::Variance, Basis::Level, &[1.0])]),
        shaped(UNEXPLAINED, vec![bias(across, &[1.0; 4])]),
        named("target-motion", json!({"velocity_mps": 0.01})),
        named("heavy-tails", json!({})),
    ];
    let correction = Correction::of(&model(&sensor(), effects), &sensor()).expect("a correction");
    assert!(correction.is_identity());
    let ids =
        ["target-bow", "edge-mixing", "vignetting", UNEXPLAINED, "target-motion", "heavy-tails"];
    assert_eq!(correction.ignored(), ids);
}

/// A curve over an unmeasured temperature is not applied at its cold end.
#[test]
fn an_unknown_temperature_changes_nothing() {
    let curve = Basis::Curve {
        over: Coordinate::Temperature,
        low: 20.0,
        high: 40.0,
        nodes: 2,
        times: Modulation::One,
    };
    let effects = vec![shaped(UNEXPLAINED, vec![bias(curve, &[0.5, 1.0])])];
    let correction = Correction::of(&model(&sensor(), effects), &sensor()).expect("a correction");
    let at = |temperature_c| {
        let mut depth = vec![1.0f32; 320 * 240];
        let conditions = Conditions { temperature_c, ..Conditions::default() };
        correction.apply(&mut depth, &conditions).expect("applied");
        f64::from(depth[0])
    };
    assert_eq!(at(None), 1.0);
    assert!((at(Some(30.0)) - FB / (FB - 0.75)).abs() < 1e-6);
}
