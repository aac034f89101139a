//! The paper's Fig. 2: sigma against tilt, a colour a distance, with the fitted curves.

mod draw;
mod groups;
mod marks;
mod overlay;

pub use overlay::Overlay;

use super::axis::Axis;
use super::sheet;
use crate::error::Result;
use crate::measure::{SigmaRow, SigmaTable};
use crate::model::{DISTANCE_RATIO, Domain, SigmaModel};
use crate::stats::range;

/// A measured sigma, carried along the fitted surface from its own distance to its group's: its
/// height over the curve is its relative residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Tilt, degrees.
    pub theta_deg: f64,
    /// Sigma, carried to the group's distance, mm.
    pub sigma_mm: f64,
    /// Its standard error, carried likewise, mm; none when the table has no n.
    pub std_error_mm: Option<f64>,
}

/// Points of about one distance, and the fit there.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// Median distance of the points, where the curve is drawn, m.
    pub z_m: f64,
    /// Least and greatest distance of the points, m.
    pub range_m: [f64; 2],
    /// The measured sigmas.
    pub points: Vec<Point>,
    /// theta (degrees), sigma (mm), lower and upper end of its 95 % interval.
    pub curve: Vec<[f64; 4]>,
}

/// A published surface at the distance of a group.
#[derive(Debug, Clone, PartialEq)]
pub struct OverlayLine {
    /// Which surface.
    pub overlay: Overlay,
    /// Index of the group whose distance it is drawn at: it has that group's colour and mark.
    pub group: usize,
    /// theta (degrees), sigma (mm).
    pub line: Vec<[f64; 2]>,
}

/// Everything Fig. 2 shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure2 {
    /// Above the figure.
    pub title: String,
    /// Tilt, degrees.
    pub x: Axis,
    /// Sigma, mm.
    pub y: Axis,
    /// By distance, nearest first; at most seven.
    pub groups: Vec<Group>,
    /// The published surfaces asked for.
    pub overlays: Vec<Overlay>,
    /// None for overlays that never measured these distances.
    pub lines: Vec<OverlayLine>,
}

/// Points of a curve.
const SAMPLES: usize = 160;
const LEVEL: f64 = 0.95;
/// From this ratio of the largest sigma to the smallest a linear axis hides the small ones.
const LOG_WHEN_RATIO: f64 = 20.0;
/// Share of the axis left free beyond the data.
const MARGIN: f64 = 0.05;
/// Narrowest tilt axis, degrees.
const NARROWEST_DEG: f64 = 10.0;
/// Curves, bands and bars are followed to this many times the largest point, not to a pole.
const BEYOND: f64 = 1.3;
const MM: f64 = 1e3;

impl Figure2 {
    /// Works out all that is drawn.
    pub fn of(table: &SigmaTable, model: &SigmaModel, overlays: &[Overlay]) -> Self {
        let groups: Vec<Group> = groups::by_distance(&table.rows)
            .into_iter()
            .map(|rows| group_of(&rows, model))
            .collect();
        let lines = overlays
            .iter()
            .flat_map(|&overlay| {
                let published = overlay.model();
                let domain = model.domain;
                groups.iter().enumerate().filter_map(move |(group, g)| {
                    let line = overlay_line(&published, g.z_m, &domain)?;
                    Some(OverlayLine { overlay, group, line })
                })
            })
            .collect();
        Figure2 {
            title: "Depth noise against tilt".into(),
            x: tilt_axis(table, model),
            y: sigma_axis(&groups),
            groups,
            overlays: overlays.to_vec(),
            lines,
        }
    }

    /// As SVG text.
    ///
    /// # Errors
    /// When plotters fails.
    pub fn svg(&self) -> Result<String> {
        sheet::svg(self)
    }

    /// As the bytes of a PNG.
    ///
    /// # Errors
    /// When plotters or the PNG encoder fails.
    pub fn png(&self) -> Result<Vec<u8>> {
        sheet::png(self)
    }
}

fn group_of(rows: &[SigmaRow], model: &SigmaModel) -> Group {
    let z_m = rows[rows.len() / 2].z_m;
    let points = rows
        .iter()
        .map(|r| {
            let carried = MM * model.sigma(z_m, r.theta_rad) / model.sigma(r.z_m, r.theta_rad);
            Point {
                theta_deg: r.theta_rad.to_degrees(),
                sigma_mm: carried * r.sigma_m,
                std_error_mm: r.std_error_m().map(|e| carried * e),
            }
        })
        .collect();
    // A published surface has no band.
    let exact = model.covariance.iter().all(|c| *c == 0.0);
    let curve = tilts(model.domain.theta_rad)
        .map(|theta| {
            let sigma = model.sigma(z_m, theta);
            let [low, high] = if exact { [sigma; 2] } else { model.interval(z_m, theta, LEVEL) };
            [theta.to_degrees(), MM * sigma, MM * low, MM * high]
        })
        .collect();
    Group { z_m, range_m: [rows[0].z_m, rows[rows.len() - 1].z_m], points, curve }
}

fn tilts([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    let steps = if high > low { SAMPLES } else { 0 };
    (0..=steps).map(move |i| low + (high - low) * i as f64 / steps.max(1) as f64)
}

/// Only where the published surface was measured.
fn overlay_line(published: &SigmaModel, z_m: f64, shown: &Domain) -> Option<Vec<[f64; 2]>> {
    let [near, far] = published.domain.z_m;
    if z_m * DISTANCE_RATIO < near || z_m > far * DISTANCE_RATIO {
        return None;
    }
    let [low, high] = published.domain.theta_rad;
    let both = [shown.theta_rad[0].max(low), shown.theta_rad[1].min(high)];
    let line = tilts(both).map(|t| [t.to_degrees(), MM * published.sigma(z_m, t)]).collect();
    (both[1] >= both[0]).then_some(line)
}

fn tilt_axis(table: &SigmaTable, model: &SigmaModel) -> Axis {
    let [low, high] = table.range(|r| r.theta_rad.to_degrees());
    let [from, to] = model.domain.theta_rad.map(f64::to_degrees);
    let [low, high] = [low.min(from), high.max(to)];
    let spare = MARGIN * (high - low).max(NARROWEST_DEG);
    Axis::linear(low - spare, high.max(low + NARROWEST_DEG) + spare).ticks_from(0.0)
}

fn sigma_axis(groups: &[Group]) -> Axis {
    let points = groups.iter().flat_map(|g| &g.points);
    let measured = range(points.clone().map(|p| p.sigma_mm));
    let reaching = points
        .flat_map(|p| [-1.0, 1.0].map(|s| p.sigma_mm + s * p.std_error_mm.unwrap_or(0.0)))
        .chain(groups.iter().flat_map(|g| &g.curve).flat_map(|c| [c[2], c[3]]))
        .map(|v| v.clamp(measured[0] / BEYOND, measured[1] * BEYOND));
    let [low, high] = range(reaching.chain(measured));
    if high > LOG_WHEN_RATIO * low {
        let spare = (high / low).powf(MARGIN);
        Axis::log(low / spare, high * spare)
    } else {
        Axis::linear(0.0, high * (1.0 + MARGIN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Form;

    fn table(tilts_deg: &[f64], distances: &[f64]) -> SigmaTable {
        let model = SigmaModel::paper();
        let row = |z_m: f64, t: f64| SigmaRow {
            z_m,
            theta_rad: t.to_radians(),
            sigma_m: model.sigma(z_m, t.to_radians()),
            n_effective: Some(100.0),
            view: 0,
        };
        let rows =
            distances.iter().flat_map(|&z| tilts_deg.iter().map(move |&t| row(z, t))).collect();
        SigmaTable { rows }
    }

    #[test]
    fn the_papers_grid_gives_seven_groups_on_a_log_axis() {
        let table = table(&[0.0, 30.0, 60.0, 76.0], &[1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0]);
        let figure = Figure2::of(&table, &SigmaModel::paper(), &Overlay::ALL);
        assert_eq!(figure.groups.len(), 7);
        assert!(figure.groups.iter().all(|g| g.points.len() == 4));
        assert!(figure.y.log);
        assert_eq!(figure.lines.len(), 21);
        let svg = figure.svg().unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("sans-serif"));
        assert!(svg.contains("σ (mm)") && svg.contains("tilt θ (degrees)"));
    }

    #[test]
    fn one_tilt_and_one_distance_still_draw() {
        for (tilts, distances) in [(&[0.0][..], &[1.0, 2.0][..]), (&[20.0], &[1.2])] {
            let table = table(tilts, distances);
            let t = tilts[0].to_radians();
            let domain = Domain { z_m: [distances[0], distances[0]], theta_rad: [t, t] };
            let model = SigmaModel::published(Form::Khoshelham, &[1.4e-3], domain);
            let figure = Figure2::of(&table, &model, &[Overlay::PaperEq1]);
            for axis in [&figure.x, &figure.y] {
                assert!(axis.low.is_finite() && axis.high > axis.low);
            }
            assert!(!figure.y.log && figure.y.low == 0.0);
            assert!(figure.svg().is_ok());
        }
    }

    /// A line is told apart by its pattern (which surface) and its mark and colour (which distance).
    #[test]
    fn an_overlay_line_knows_its_group() {
        let figure =
            Figure2::of(&table(&[0.0, 9.0], &[1.0, 2.0]), &SigmaModel::paper(), &Overlay::ALL);
        let pairs: Vec<_> = figure.lines.iter().map(|l| (l.overlay, l.group)).collect();
        let expected: Vec<_> = Overlay::ALL.into_iter().flat_map(|o| [(o, 0), (o, 1)]).collect();
        assert_eq!(pairs, expected);
        for line in &figure.lines {
            let z = figure.groups[line.group].z_m;
            approx::assert_relative_eq!(line.line[0][1], MM * line.overlay.model().sigma(z, 0.0));
        }
    }

    #[test]
    fn an_overlay_keeps_to_the_distances_it_measured() {
        let figure = Figure2::of(
            &table(&[0.0, 10.0], &[0.6, 1.0]),
            &SigmaModel::nguyen(),
            &[Overlay::PaperEq1],
        );
        assert_eq!(figure.lines.len(), 1, "0.6 m is nearer than the paper's views");
    }
}
