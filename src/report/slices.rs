//! Slices through the surface with the measured points: sigma against distance at a few tilts, sigma against
//! tilt at a few distances (the paper's Fig. 2). Also the residuals of the fit.

mod held;

use held::Held;
use plotters::style::{Color, RGBColor, WHITE};

use super::axis::Axis;
use super::chart::{Chart, Entry, Layer, Mark, Sample, Stroke};
use super::colours::{self, FAINT, INK};
use super::coverage::is_measured;
use super::numbers::{MM, fixed, millimetres};
use super::overlay::Overlay;
use crate::measure::{SigmaRow, SigmaTable};
use crate::model::SigmaModel;
use crate::stats::range;

/// Samples along a curve.
const SAMPLES: usize = 160;
const LEVEL: f64 = 0.95;
/// Ratio of the largest to the smallest sigma from which a linear axis hides the small ones.
const LOG_FROM_RATIO: f64 = 20.0;
/// Share of the axis left free beyond the data.
const MARGIN: f64 = 0.05;
/// Narrowest tilt axis, degrees.
const MIN_TILT_RANGE_DEG: f64 = 10.0;
/// Largest factor by which bands and bars extend the axis beyond the points; a band may reach to a pole.
const BEYOND: f64 = 1.3;
const BAND_OPACITY: f64 = 0.16;
/// Number of points above which marks are smaller and their edges fainter.
const MANY_POINTS: usize = 120;
/// Distance of an overlay's mark from its line, share of the axis.
const BESIDE: f64 = 0.015;

/// Points at about one distance or tilt, and the fit there; x is degrees or m, y mm.
struct Group {
    /// Median of the fixed quantity, m or rad.
    held: f64,
    label: String,
    /// Sigma of each point, moved along the fitted surface from its own distance or tilt to the group's.
    points: Vec<[f64; 2]>,
    /// Plus and minus one standard error, where it is known.
    bars: Vec<[f64; 3]>,
    /// The fit, NaN where nothing was measured nearby.
    curve: Vec<[f64; 2]>,
    /// The curve's 95 % interval, one piece per measured stretch.
    bands: Vec<Vec<[f64; 3]>>,
    tips: Vec<([f64; 2], String)>,
    colour: RGBColor,
    mark: Mark,
}

/// Sigma against tilt, with the fit and the published surfaces at the same distances. `names` are those of
/// the views, for the points' tips.
pub fn figure2(
    table: &SigmaTable,
    model: &SigmaModel,
    overlays: &[Overlay],
    names: &[&str],
) -> Chart {
    let groups = Held::Distance.groups(table, model, names);
    let tilts = table.rows.iter().map(|r| r.theta_rad).chain(model.domain.theta_rad);
    let [low, high] = range(tilts.map(f64::to_degrees));
    let spare = MARGIN * (high - low).max(MIN_TILT_RANGE_DEG);
    let high = high.max(low + MIN_TILT_RANGE_DEG);
    let x = Axis::linear(low - spare, high + spare).ticks_from(0.0);
    let axes = [x, sigma_axis(&groups)];
    let chart = Chart::new("Depth noise against tilt", axes, ["tilt θ (degrees)", "σ (mm)"]);
    Held::Distance.drawn(chart, &groups, model, overlays)
}

/// Sigma against distance, with the fit at a few tilts and the published surfaces at the smallest tilt.
pub fn against_distance(table: &SigmaTable, model: &SigmaModel, names: &[&str]) -> Chart {
    let groups = Held::Tilt.groups(table, model, names);
    let axes = [distance_axis(table), sigma_axis(&groups)];
    let chart = Chart::new("Depth noise against distance", axes, ["distance z (m)", "σ (mm)"]);
    Held::Tilt.drawn(chart, &groups, model, &Overlay::ALL)
}

/// Relative residuals of the fit against distance.
pub fn fit_residuals(table: &SigmaTable, model: &SigmaModel, names: &[&str]) -> Chart {
    let off =
        |r: &SigmaRow, sigma_m: f64| 100.0 * (sigma_m / model.sigma(r.z_m, r.theta_rad) - 1.0);
    let groups = Held::Tilt.sorted(&table.rows);
    let looks = looks(groups.len(), table.rows.len());
    let points = table.rows.iter().map(|r| off(r, r.sigma_m));
    let y = range(points.chain([0.0]));
    let axes = [distance_axis(table), Axis::with_margin(y, 2.0 * MARGIN)];
    let labels = ["distance z (m)", "measured minus fitted σ (% of the fit)"];
    let mut chart = Chart::new("Residuals of the fit", axes, labels);
    let zero = [chart.x.low, chart.x.high].map(|x| [x, 0.0]).to_vec();
    chart.layers.push(Layer::Line(zero, Stroke::new(FAINT, 1).dashed([5, 4])));
    chart.legend.push(Entry::new([], "tilt θ:"));
    for (rows, (colour, mark)) in groups.iter().zip(looks) {
        let bar = |r: &SigmaRow| {
            let error = r.std_error_m()?;
            Some([r.z_m, off(r, r.sigma_m - error), off(r, r.sigma_m + error)])
        };
        let place = |r: &SigmaRow| [r.z_m, off(r, r.sigma_m)];
        let bars = rows.iter().filter_map(bar).collect();
        chart.layers.push(Layer::ErrorBars(bars, Stroke::new(colour, 1)));
        chart.layers.push(Layer::Marks(rows.iter().map(place).collect(), mark));
        chart.tips.extend(rows.iter().map(|r| (place(r), tip(r, names))));
        chart.legend.push(Entry::new([Sample::Mark(mark)], Held::Tilt.label(rows)));
    }
    chart
}

fn distance_axis(table: &SigmaTable) -> Axis {
    Axis::with_margin(range(table.rows.iter().map(|r| r.z_m)), MARGIN).ticks_from(0.0)
}

/// Colour and mark of each group.
fn looks(groups: usize, points: usize) -> Vec<(RGBColor, Mark)> {
    let (radius, edge) = if points > MANY_POINTS { (4, INK.mix(0.6)) } else { (5, INK.into()) };
    let look = |i: usize| {
        let share = i as f64 / (groups.max(2) - 1) as f64;
        let colour = colours::between(&colours::DISTANCES, share);
        (colour, Mark { shape: i, radius, fill: colour.into(), edge })
    };
    (0..groups).map(look).collect()
}

/// Describes a point by its view's name, z, tilt and sigma.
pub(super) fn tip(row: &SigmaRow, names: &[&str]) -> String {
    let name = names.get(row.view).map_or_else(String::new, |name| format!("{name}: "));
    let error = row.std_error_m().map_or_else(String::new, |e| format!(" ± {}", millimetres(e)));
    let (z, tilt) = (fixed(row.z_m, 3), fixed(row.theta_rad.to_degrees(), 1));
    format!("{name}z {z} m, tilt {tilt}°, σ {}{error} mm", millimetres(row.sigma_m))
}

impl Held {
    fn groups(self, table: &SigmaTable, model: &SigmaModel, names: &[&str]) -> Vec<Group> {
        let groups = self.sorted(&table.rows);
        let looks = looks(groups.len(), table.rows.len());
        groups.iter().zip(looks).map(|(rows, look)| self.group(rows, model, names, look)).collect()
    }

    fn group(
        self,
        rows: &[SigmaRow],
        model: &SigmaModel,
        names: &[&str],
        (colour, mark): (RGBColor, Mark),
    ) -> Group {
        let middle = &rows[rows.len() / 2];
        let held = self.split(middle.z_m, middle.theta_rad).1;
        let carried = |r: &SigmaRow| {
            let (z, theta) = self.place(self.split(r.z_m, r.theta_rad).0, held);
            MM * model.sigma(z, theta) / model.sigma(r.z_m, r.theta_rad)
        };
        let point = |r: &SigmaRow| [self.split(r.z_m, r.theta_rad).0, carried(r) * r.sigma_m];
        let bar = |r: &SigmaRow| {
            let ([x, sigma], error) = (point(r), carried(r) * r.std_error_m()?);
            Some([x, sigma - error, sigma + error])
        };
        let exact = model.covariance.iter().all(|c| *c == 0.0);
        let edges = |x: f64| {
            let (z, theta) = self.place(x, held);
            let [low, high] = match exact {
                true => [model.sigma(z, theta); 2],
                false => model.interval(z, theta, LEVEL),
            };
            [x, MM * low, MM * high]
        };
        let measured = |x: f64| {
            let (z, theta) = self.place(x, held);
            is_measured(rows, z, theta)
        };
        let xs: Vec<f64> = samples(self.along(model)).collect();
        let pieces = xs.chunk_by(|a, b| measured(*a) == measured(*b)).filter(|p| measured(p[0]));
        let curve = self.curve(model, held, xs.iter().copied()).into_iter();
        Group {
            held,
            label: self.label(rows),
            points: rows.iter().map(point).collect(),
            bars: rows.iter().filter_map(bar).collect(),
            curve: curve.map(|[x, y]| [x, if measured(x) { y } else { f64::NAN }]).collect(),
            bands: pieces.map(|piece| piece.iter().map(|x| edges(*x)).collect()).collect(),
            tips: rows.iter().map(|r| (point(r), tip(r, names))).collect(),
            colour,
            mark,
        }
    }

    fn curve(self, model: &SigmaModel, held: f64, xs: impl Iterator<Item = f64>) -> Vec<[f64; 2]> {
        let at = |x: f64| {
            let (z, theta) = self.place(x, held);
            [x, MM * model.sigma(z, theta)]
        };
        xs.map(at).collect()
    }

    fn drawn(
        self,
        mut chart: Chart,
        groups: &[Group],
        model: &SigmaModel,
        overlays: &[Overlay],
    ) -> Chart {
        let bands = |g: &Group| -> Vec<Layer> {
            g.bands.iter().map(|b| Layer::Band(b.clone(), g.colour.mix(BAND_OPACITY))).collect()
        };
        let each = |layer: fn(&Group) -> Layer| groups.iter().map(layer);
        chart.layers.extend(groups.iter().flat_map(bands));
        let drawn: Vec<bool> =
            overlays.iter().map(|o| self.draw_overlay(&mut chart, o, groups, model)).collect();
        chart.layers.extend(each(|g| Layer::Line(g.curve.clone(), Stroke::new(g.colour, 2))));
        chart.layers.extend(each(|g| Layer::ErrorBars(g.bars.clone(), Stroke::new(g.colour, 1))));
        chart.layers.extend(each(|g| Layer::Marks(g.points.clone(), g.mark)));
        chart.tips = groups.iter().flat_map(|g| g.tips.clone()).collect();
        chart.legend = self.legend(groups, overlays, &drawn);
        chart
    }

    /// Draws a published surface over its measured range: at every group's distance, or at the smallest tilt
    /// only. Each distance's line has the group's colour and, at its most frontal end, the group's mark,
    /// open, for readers without colour. Returns whether anything was drawn.
    fn draw_overlay(
        self,
        chart: &mut Chart,
        overlay: &Overlay,
        groups: &[Group],
        model: &SigmaModel,
    ) -> bool {
        let published = (overlay.model)();
        let ([a, b], [low, high]) = (self.along(model), self.along(&published));
        let ends = [a.max(low), b.min(high)];
        let before = chart.layers.len();
        let shown = if self == Held::Tilt { 1 } else { groups.len() };
        for group in groups.iter().take(shown) {
            if !self.has(&published, group.held) || ends[1] < ends[0] {
                continue;
            }
            let line = self.curve(&published, group.held, samples(ends));
            let colour = match self {
                Held::Distance => colours::darker(group.colour),
                Held::Tilt => INK,
            };
            let beside = BESIDE * (chart.x.high - chart.x.low);
            let visible = line.iter().find(|p| chart.y.contains(p[1]));
            let marks = visible.map(|[x, sigma]| [x - beside, *sigma]).into_iter().collect();
            let mark = Mark { radius: 4, fill: WHITE.into(), edge: colour.into(), ..group.mark };
            chart.layers.push(Layer::Line(line, Stroke::new(colour, 1).dashed(overlay.dashes)));
            if self == Held::Distance {
                chart.layers.push(Layer::Marks(marks, mark));
            }
        }
        chart.layers.len() > before
    }

    fn legend(self, groups: &[Group], overlays: &[Overlay], drawn: &[bool]) -> Vec<Entry> {
        let (held, name) = match self {
            Held::Distance => ("distance z:", "distance"),
            Held::Tilt => ("tilt θ:", "tilt"),
        };
        let mut legend = vec![Entry::new([], held)];
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
        let open = self == Held::Distance && drawn.contains(&true);
        let open = open.then_some("open marks: their distance");
        let carried = format!("carried to the curve's {name}");
        let remarks = open.into_iter().chain([points, &carried]);
        legend.extend(remarks.map(|remark| Entry::new([], remark)));
        legend
    }
}

fn samples([low, high]: [f64; 2]) -> impl Iterator<Item = f64> {
    let steps = if high > low { SAMPLES } else { 0 };
    (0..=steps).map(move |i| low + (high - low) * i as f64 / steps.max(1) as f64)
}

fn sigma_axis(groups: &[Group]) -> Axis {
    let measured = range(groups.iter().flat_map(|g| &g.points).map(|p| p[1]));
    let reaching = groups.iter().flat_map(|g| g.bars.iter().chain(g.bands.iter().flatten()));
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

#[cfg(test)]
mod tests;
