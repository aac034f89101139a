//! The paper's Fig. 2: sigma against tilt, a colour a distance, with the fitted curves.

use std::str::FromStr;

use plotters::style::{Color, RGBColor, WHITE};

use super::axis::Axis;
use super::chart::{Chart, Entry, Layer, Mark, Sample, Stroke};
use super::colours::{self, INK};
use super::numbers::{MM, fixed, range as numbers};
use crate::measure::{SigmaRow, SigmaTable};
use crate::model::{DISTANCE_RATIO, SigmaModel};
use crate::stats::range;

/// A published surface, drawn beside the fit over the range that its authors measured.
#[derive(Debug, Clone, Copy)]
pub struct Overlay {
    /// As on the command line.
    pub id: &'static str,
    /// As in a legend.
    pub label: &'static str,
    /// The surface with the range that was measured.
    pub model: fn() -> SigmaModel,
    dashes: [i32; 2],
}

impl Overlay {
    /// The paper's Eq. 1; Nguyen, Izadi and Lovell; Khoshelham and Elberink.
    pub const ALL: [Overlay; 3] = [
        Overlay { id: "eq1", label: "paper, Eq. 1", model: SigmaModel::paper, dashes: [9, 5] },
        Overlay {
            id: "nguyen",
            label: "Nguyen et al. 2012",
            model: SigmaModel::nguyen,
            dashes: [2, 4],
        },
        Overlay {
            id: "khoshelham",
            label: "Khoshelham 2012",
            model: SigmaModel::khoshelham,
            dashes: [15, 3],
        },
    ];
}

impl FromStr for Overlay {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Overlay::ALL.into_iter().find(|o| o.id == text).ok_or_else(|| {
            let known = Overlay::ALL.map(|o| o.id).join(", ");
            format!("there is no overlay \"{text}\"; the overlays are {known}")
        })
    }
}

/// More colours and shapes than this cannot be told apart.
const MAX_GROUPS: usize = 7;
/// Distances within a group differ by less than this: sigma ~ z^2 then by less than half.
const MAX_RATIO: f64 = 1.25;
/// Points of a curve.
const SAMPLES: usize = 160;
const LEVEL: f64 = 0.95;
/// From this ratio of the largest sigma to the smallest a linear axis hides the small ones.
const LOG_FROM_RATIO: f64 = 20.0;
/// Share of the axis left free beyond the data.
const MARGIN: f64 = 0.05;
/// Narrowest tilt axis, degrees.
const MIN_TILT_RANGE_DEG: f64 = 10.0;
/// Curves, bands and bars are followed to this many times the largest point, not to a pole.
const BEYOND: f64 = 1.3;
const BAND_OPACITY: f64 = 0.16;
/// With more points than this their marks shrink and their edges fade.
const MANY_POINTS: usize = 120;
/// How far beside its line an overlay's mark stands, share of the axis.
const BESIDE: f64 = 0.015;

/// Points of about one distance, and the fit there; degrees and mm.
struct Group {
    /// Median distance of the points, where the curve is drawn, m.
    z_m: f64,
    label: String,
    /// Sigma is carried along the fitted surface from its own distance to the group's.
    points: Vec<[f64; 2]>,
    /// One standard error either way, where it is known.
    bars: Vec<[f64; 3]>,
    curve: Vec<[f64; 2]>,
    /// The curve's 95 % interval.
    band: Vec<[f64; 3]>,
    colour: RGBColor,
    mark: Mark,
}

/// Sigma against tilt, with the fit and the published surfaces at the same distances.
pub fn figure2(table: &SigmaTable, model: &SigmaModel, overlays: &[Overlay]) -> Chart {
    let rows = by_distance(&table.rows);
    let many = table.rows.len() > MANY_POINTS;
    let groups: Vec<Group> = rows
        .iter()
        .enumerate()
        .map(|(i, of)| {
            let colour =
                colours::between(&colours::DISTANCES, i as f64 / (rows.len().max(2) - 1) as f64);
            let (radius, edge) = if many { (4, INK.mix(0.6)) } else { (5, INK.into()) };
            group(of, model, colour, Mark { shape: i, radius, fill: colour.into(), edge })
        })
        .collect();
    let axes = [tilt_axis(table, model), sigma_axis(&groups)];
    let mut chart = Chart::new("Depth noise against tilt", axes, ["tilt θ (degrees)", "σ (mm)"]);
    let each = |layer: fn(&Group) -> Layer| groups.iter().map(layer);
    chart.layers.extend(each(|g| Layer::Band(g.band.clone(), g.colour.mix(BAND_OPACITY))));
    let drawn: Vec<bool> =
        overlays.iter().map(|o| draw_overlay(&mut chart, o, &groups, model)).collect();
    chart.layers.extend(each(|g| Layer::Line(g.curve.clone(), Stroke::new(g.colour, 2))));
    chart.layers.extend(each(|g| Layer::ErrorBars(g.bars.clone(), Stroke::new(g.colour, 1))));
    chart.layers.extend(each(|g| Layer::Marks(g.points.clone(), g.mark)));
    chart.legend = legend(&groups, overlays, &drawn);
    chart
}

fn group(rows: &[SigmaRow], model: &SigmaModel, colour: RGBColor, mark: Mark) -> Group {
    let z_m = rows[rows.len() / 2].z_m;
    let carried =
        |r: &SigmaRow| MM * model.sigma(z_m, r.theta_rad) / model.sigma(r.z_m, r.theta_rad);
    let point = |r: &SigmaRow| [r.theta_rad.to_degrees(), carried(r) * r.sigma_m];
    let bar = |r: &SigmaRow| {
        let ([tilt, sigma], error) = (point(r), carried(r) * r.std_error_m()?);
        Some([tilt, sigma - error, sigma + error])
    };
    let exact = model.covariance.iter().all(|c| *c == 0.0);
    let interval = |theta: f64| match exact {
        true => [model.sigma(z_m, theta); 2],
        false => model.interval(z_m, theta, LEVEL),
    };
    let edges = |theta: f64| {
        let [low, high] = interval(theta);
        [theta.to_degrees(), MM * low, MM * high]
    };
    // Distances that print alike are one.
    let (z, ends) = (fixed(z_m, 2), [rows[0].z_m, rows[rows.len() - 1].z_m]);
    let others = if numbers(ends, 2) == z { "".into() } else { format!(" ({})", numbers(ends, 1)) };
    Group {
        z_m,
        label: format!("{z} m{others}"),
        points: rows.iter().map(point).collect(),
        bars: rows.iter().filter_map(bar).collect(),
        curve: curve(model, z_m, model.domain.theta_rad),
        band: tilts(model.domain.theta_rad).map(edges).collect(),
        colour,
        mark,
    }
}

fn curve(model: &SigmaModel, z_m: f64, tilts_rad: [f64; 2]) -> Vec<[f64; 2]> {
    tilts(tilts_rad).map(|t| [t.to_degrees(), MM * model.sigma(z_m, t)]).collect()
}

fn tilts([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    let steps = if high > low { SAMPLES } else { 0 };
    (0..=steps).map(move |i| low + (high - low) * i as f64 / steps.max(1) as f64)
}

/// A published surface at every distance where it was measured, in the distance's colour; an open
/// mark at its squarest end says which distance where colours are lost. Was anything drawn?
fn draw_overlay(
    chart: &mut Chart,
    overlay: &Overlay,
    groups: &[Group],
    model: &SigmaModel,
) -> bool {
    let published = (overlay.model)();
    let [near, far] = published.domain.z_m;
    let [low, high] = published.domain.theta_rad;
    let tilts_rad = [model.domain.theta_rad[0].max(low), model.domain.theta_rad[1].min(high)];
    let before = chart.layers.len();
    for group in groups {
        let z = group.z_m;
        if z * DISTANCE_RATIO < near || z > far * DISTANCE_RATIO || tilts_rad[1] < tilts_rad[0] {
            continue;
        }
        let line = curve(&published, z, tilts_rad);
        let colour = colours::darker(group.colour);
        let beside = BESIDE * (chart.x.high - chart.x.low);
        let visible = line.iter().find(|p| chart.y.contains(p[1]));
        let marks = visible.map(|[tilt, sigma]| [tilt - beside, *sigma]).into_iter().collect();
        let mark = Mark { radius: 4, fill: WHITE.into(), edge: colour.into(), ..group.mark };
        chart.layers.push(Layer::Line(line, Stroke::new(colour, 1).dashed(overlay.dashes)));
        chart.layers.push(Layer::Marks(marks, mark));
    }
    chart.layers.len() > before
}

fn legend(groups: &[Group], overlays: &[Overlay], drawn: &[bool]) -> Vec<Entry> {
    let mut legend = vec![Entry::new([], "distance z:")];
    legend.extend(groups.iter().map(|group| {
        let line = Sample::Line(Stroke::new(group.colour, 2));
        Entry::new([line, Sample::Mark(group.mark)], &*group.label)
    }));
    let fit = [Sample::Band(INK.mix(BAND_OPACITY)), Sample::Line(Stroke::new(INK, 2))];
    legend.push(Entry::new(fit, "fit, 95 % band"));
    for (overlay, drawn) in overlays.iter().zip(drawn) {
        let line = Sample::Line(Stroke::new(INK, 1).dashed(overlay.dashes));
        legend.push(Entry::new([line], overlay.label));
        legend.extend((!drawn).then(|| Entry::new([], "(nothing measured here)")));
    }
    let bars = groups.iter().any(|g| !g.bars.is_empty());
    let points = if bars { "points: measured ± 1 s.e.," } else { "points: measured," };
    let open = drawn.contains(&true).then_some("open marks: their distance");
    let remarks = open.into_iter().chain([points, "carried to the curve's distance"]);
    legend.extend(remarks.map(|remark| Entry::new([], remark)));
    legend
}

fn tilt_axis(table: &SigmaTable, model: &SigmaModel) -> Axis {
    let tilts = table.rows.iter().map(|r| r.theta_rad).chain(model.domain.theta_rad);
    let [low, high] = range(tilts.map(f64::to_degrees));
    let spare = MARGIN * (high - low).max(MIN_TILT_RANGE_DEG);
    Axis::linear(low - spare, high.max(low + MIN_TILT_RANGE_DEG) + spare).ticks_from(0.0)
}

fn sigma_axis(groups: &[Group]) -> Axis {
    let measured = range(groups.iter().flat_map(|g| &g.points).map(|p| p[1]));
    let reaching = groups.iter().flat_map(|g| g.bars.iter().chain(&g.band));
    let ends = reaching.flat_map(|[_, low, high]| [*low, *high]);
    let near = ends.map(|v| v.clamp(measured[0] / BEYOND, measured[1] * BEYOND));
    let [low, high] = range(near.chain(measured));
    if high > LOG_FROM_RATIO * low {
        let spare = (high / low).powf(MARGIN);
        Axis::log(low / spare, high * spare)
    } else {
        Axis::linear(0.0, high * (1.0 + MARGIN))
    }
}

/// Rows by distance, nearest group first, sorted inside; none of the groups is empty.
///
/// Where the distances leave gaps the groups are those of the recording; where they run on,
/// they are cut into equal ratios (not equal counts, which would put equal distances apart).
fn by_distance(rows: &[SigmaRow]) -> Vec<Vec<SigmaRow>> {
    let mut sorted = rows.to_vec();
    sorted.sort_by(|a, b| a.z_m.total_cmp(&b.z_m));
    let natural: Vec<Vec<SigmaRow>> =
        sorted.chunk_by(|a, b| b.z_m <= a.z_m * DISTANCE_RATIO).map(<[SigmaRow]>::to_vec).collect();
    let compact = |g: &Vec<SigmaRow>| g[g.len() - 1].z_m < MAX_RATIO * g[0].z_m;
    if natural.len() <= MAX_GROUPS && natural.iter().all(compact) {
        return natural;
    }
    let [low, high] = [sorted[0].z_m, sorted[sorted.len() - 1].z_m];
    let extent = (high / low).ln();
    let count = (extent / MAX_RATIO.ln()).ceil().clamp(1.0, MAX_GROUPS as f64);
    let bin = |r: &SigmaRow| ((r.z_m / low).ln() / extent * count).min(count - 1.0) as usize;
    sorted.chunk_by(|a, b| bin(a) == bin(b)).map(<[SigmaRow]>::to_vec).collect()
}

#[cfg(test)]
mod tests;
