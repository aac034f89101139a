use super::held::MAX_GROUPS;
use super::*;
use crate::model::{Domain, Form};

fn table(tilts_deg: &[f64], distances: impl IntoIterator<Item = f64>) -> SigmaTable {
    let model = SigmaModel::paper();
    let row = |z_m: f64, t: f64| SigmaRow {
        z_m,
        theta_rad: t.to_radians(),
        sigma_m: model.sigma(z_m, t.to_radians()),
        n_effective: Some(100.0),
        view: 0,
    };
    let rows = distances.into_iter().flat_map(|z| tilts_deg.iter().map(move |&t| row(z, t)));
    SigmaTable { rows: rows.collect() }
}

fn count(chart: &Chart, wanted: impl Fn(&Layer) -> bool) -> usize {
    chart.layers.iter().filter(|layer| wanted(layer)).count()
}

fn is_overlay(layer: &Layer) -> bool {
    matches!(layer, Layer::Line(_, stroke) if stroke.dashes.is_some())
}

#[test]
fn the_papers_grid_gives_seven_groups_on_a_log_axis() {
    let table = table(&[0.0, 30.0, 60.0, 76.0], [1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]);
    let chart = figure2(&table, &SigmaModel::paper(), &Overlay::ALL, &[]);
    // Between 30 and 60 degrees lies more than a step of the paper's grid: separate pieces, no curve between.
    assert_eq!(count(&chart, |l| matches!(l, Layer::Band(..))), 7 * 3);
    let curve = chart.layers.iter().find_map(|l| match l {
        Layer::Line(points, stroke) if stroke.dashes.is_none() => Some(points),
        _ => None,
    });
    for [tilt, sigma] in curve.unwrap() {
        let gap = [10.0..20.0, 40.0..50.0].iter().any(|gap| gap.contains(tilt));
        assert_eq!(sigma.is_nan(), gap, "{tilt} degrees");
    }
    assert_eq!(count(&chart, |l| matches!(l, Layer::ErrorBars(bars, _) if bars.len() == 4)), 7);
    assert!(chart.y.log);
    assert_eq!(count(&chart, is_overlay), 21);
    let svg = chart.svg().unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("sans-serif"));
    assert!(svg.contains("σ (mm)") && svg.contains("tilt θ (degrees)"));
}

#[test]
fn one_tilt_and_one_distance_still_draw() {
    for (tilt, distances) in [(0.0, &[1.0, 2.0][..]), (20.0, &[1.2])] {
        let t = f64::to_radians(tilt);
        let domain = Domain { z_m: [distances[0], distances[0]], theta_rad: [t, t] };
        let model = SigmaModel::published(Form::Khoshelham, &[1.4e-3], domain);
        let table = table(&[tilt], distances.iter().copied());
        let chart = figure2(&table, &model, &Overlay::ALL[..1], &[]);
        for axis in [&chart.x, &chart.y] {
            assert!(axis.low.is_finite() && axis.high > axis.low);
        }
        assert!(!chart.y.log && chart.y.low == 0.0);
        assert!(chart.svg().is_ok());
    }
}

/// The dash pattern tells the surface, colour and mark tell the distance.
#[test]
fn an_overlay_has_the_mark_of_its_distance() {
    let chart = figure2(&table(&[0.0, 9.0], [1.0, 2.0]), &SigmaModel::paper(), &Overlay::ALL, &[]);
    let overlays: Vec<&[Layer]> = chart.layers.windows(2).filter(|w| is_overlay(&w[0])).collect();
    assert_eq!(overlays.len(), 6);
    for (i, pair) in overlays.into_iter().enumerate() {
        let [Layer::Line(line, stroke), Layer::Marks(_, mark)] = pair else { panic!("{pair:?}") };
        let (overlay, group) = (Overlay::ALL[i / 2], i % 2);
        assert_eq!((stroke.dashes, mark.shape), (Some(overlay.dashes), group));
        let sigma = (overlay.model)().sigma([1.0, 2.0][group], 0.0);
        approx::assert_relative_eq!(line[0][1], MM * sigma);
    }
}

#[test]
fn an_overlay_has_a_name_and_keeps_to_the_distances_it_measured() {
    for overlay in Overlay::ALL {
        assert_eq!(overlay.id.parse::<Overlay>().unwrap().label, overlay.label);
    }
    assert!("eq2".parse::<Overlay>().unwrap_err().contains("eq1, nguyen, khoshelham"));
    let table = table(&[0.0, 10.0], [0.6, 1.0]);
    let chart = figure2(&table, &SigmaModel::nguyen(), &Overlay::ALL[..1], &[]);
    assert_eq!(count(&chart, is_overlay), 1, "0.6 m is nearer than the paper's views");
}

#[test]
fn distances_become_groups_by_their_gaps_or_by_equal_ratios() {
    let groups =
        |distances: &[f64]| Held::Distance.sorted(&table(&[0.0], distances.iter().copied()).rows);
    let sizes = |distances: &[f64]| groups(distances).iter().map(Vec::len).collect::<Vec<_>>();
    assert_eq!(sizes(&[2.0, 1.0, 1.01, 2.02, 3.0, 1.0]), [3, 2, 1]);
    assert_eq!(sizes(&[1.0]), [1]);
    assert!(Held::Distance.sorted(&[]).is_empty());
    let many: Vec<f64> = (0..400).map(|i| 0.5 + 0.01 * f64::from(i)).collect();
    let put_together = groups(&many);
    assert!(put_together.len() <= MAX_GROUPS && sizes(&many).iter().sum::<usize>() == 400);
    assert!(put_together.windows(2).all(|w| w[0][w[0].len() - 1].z_m < w[1][0].z_m));
    let apart: Vec<f64> = (1..=20).map(|i| 0.5 * f64::from(i)).collect();
    assert!((3..=MAX_GROUPS).contains(&groups(&apart).len()));
}

#[test]
fn against_distance_each_tilt_is_a_curve_and_every_point_tells_its_view() {
    let table = table(&[0.0, 2.0, 30.0], [1.0, 1.2, 2.0]);
    let chart = against_distance(&table, &SigmaModel::paper(), &["wall"]);
    let curves = count(&chart, |l| matches!(l, Layer::Line(_, stroke) if stroke.dashes.is_none()));
    assert_eq!(curves, 2, "0 and 2 degrees are one tilt");
    assert_eq!(chart.tips.len(), 9);
    assert!(chart.tips[0].1.starts_with("wall: z 1.000 m, tilt 0.0°, σ "), "{}", chart.tips[0].1);
    assert!(chart.svg().unwrap().contains("<title>wall: z 1.000 m"));
    let narrow = chart.narrow().unwrap();
    assert!(narrow.size.0 == 400 && narrow.svg().is_ok() && narrow.narrow().is_none());
    let off = fit_residuals(&table, &SigmaModel::paper(), &[]);
    assert!(off.tips.iter().all(|([_, percent], _)| percent.abs() < 1e-9), "{:?}", off.tips);
}
