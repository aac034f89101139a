use std::path::{Path, PathBuf};

use clap::Args;
use kinoise::fleet::{
    BiasOfUnit, Change, Comparison, ParameterOfUnit, SharedBias, SharedEffect, SharedSigma,
    Standing, UnitModel, compare,
};
use kinoise::units::{counted, shortest, to_digits};

use super::common::Global;
use super::console::{notes, result};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise units A/model.json B/model.json C/model.json
  kinoise units spring/model.json autumn/model.json --json > units.json")]
pub struct Arguments {
    /// model.json of units of one kind, or the folders they are in; models of the same serial number
    /// show whether that unit has changed since
    #[arg(value_name = "MODEL")]
    models: Vec<PathBuf>,
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let models = arguments.models.iter().map(|path| UnitModel::read(path));
    let models = models.collect::<kinoise::Result<Vec<_>>>()?;
    let comparison = compare(&models)?;
    report(&comparison);
    global.print_json(&serde_json::to_value(&comparison)?)
}

fn report(comparison: &Comparison) {
    let Comparison { sensor, width, height, units, .. } = comparison;
    let count = counted(units.len(), "unit");
    result(format!("{count} of \"{sensor}\", {width} x {height} px"));
    if let Some(sigma) = &comparison.sigma {
        report_sigma(sigma);
    }
    if let Some(bias) = &comparison.bias {
        report_bias(bias);
    }
    if !comparison.effects.is_empty() {
        result("\neffects, as the models describe them");
        comparison.effects.iter().for_each(report_effect);
    }
    if !comparison.changes.is_empty() {
        result("\nchanged since?");
        comparison.changes.iter().for_each(report_change);
    }
    notes(&comparison.remarks);
}

fn report_sigma(sigma: &SharedSigma) {
    result("\nsigma along the optical axis, mm, with its standard error");
    let width = sigma.standings.iter().map(|s| s.unit.chars().count()).max().unwrap_or(0).max(13);
    let row = |name: &str, cell: &dyn Fn(usize) -> String| {
        let cells: Vec<String> =
            (0..sigma.places.len()).map(|i| format!("{:>17}", cell(i))).collect();
        result(format!("{name:width$}{}", cells.concat()));
    };
    let at = |i: usize| &sigma.places[i];
    let place = |i: usize| place(at(i).z_m, at(i).theta_rad);
    row("", &place);
    for (k, standing) in sigma.standings.iter().enumerate() {
        row(&standing.unit, &|i| {
            let unit = &at(i).units[k];
            format!("{:.3} +- {:.3}", 1e3 * unit.sigma_m, 1e3 * unit.std_error_m)
        });
    }
    row("in common", &|i| format!("{:.3}", 1e3 * at(i).common_m));
    let span = |[low, high]: [f64; 2], digits: usize| format!("{low:.digits$} to {high:.digits$}");
    row("  95 %", &|i| span(mm(at(i).common_interval_m), 3));
    row("units scatter", &|i| format!("{:.1} %", 1e2 * at(i).scatter));
    row("  95 %", &|i| span(at(i).scatter_interval.map(|v| 1e2 * v), 1));
    report_standings("sigma", &sigma.standings, &|k| {
        let departure = |i: &usize| at(*i).units[k].departure;
        let places = 0..sigma.places.len();
        let largest = places.max_by(|a, b| departure(a).abs().total_cmp(&departure(b).abs()));
        largest.map_or(String::new(), |i| {
            let [low, high] = at(i).units[k].departure_interval;
            let [off, low, high] = [departure(&i), low, high].map(|v| 1e2 * v);
            format!("{off:+.0} % ({low:+.0} to {high:+.0}) at {}", place(i))
        })
    });
}

fn report_bias(bias: &SharedBias) {
    result("\nbias of depth over the picture, mm rms");
    for d in &bias.distances {
        let of = |u: &BiasOfUnit| {
            let [rms, error] = mm([u.rms_m, u.error_rms_m]);
            format!("{} {rms:.2} (error {error:.2})", u.unit)
        };
        let units = d.units.iter().map(of).collect::<Vec<_>>().join(", ");
        let (z, [common, scatter]) = (d.z_m, mm([d.common_rms_m, d.scatter_rms_m]));
        result(format!("{z:.2} m: in common {common:.2}, units scatter {scatter:.2}; {units}"));
    }
    report_standings("bias", &bias.standings, &|k| {
        bias.distances.last().map_or(String::new(), |d| {
            format!("{:.2} mm rms off at {:.2} m", 1e3 * d.units[k].departure_rms_m, d.z_m)
        })
    });
}

/// Reports which units agree and which differ; `how_far` describes a unit's departure from the others.
fn report_standings(what: &str, standings: &[Standing], how_far: &dyn Fn(usize) -> String) {
    let core = standings.iter().filter(|s| !s.is_own).map(|s| s.unit.as_str());
    match &*core.collect::<Vec<_>>().join(", ") {
        "" => result(format!("no two units share a {what}: each needs its own model")),
        core => result(format!("in common: {core} share one {what} within the errors")),
    }
    for (k, s) in standings.iter().enumerate().filter(|(_, s)| s.is_own) {
        let (unit, far, p) = (&s.unit, how_far(k), p(s.p_adjusted));
        result(format!("its own: {unit} has another {what}: {far}, {p}"));
    }
}

fn mm<const N: usize>(metres: [f64; N]) -> [f64; N] {
    metres.map(|v| 1e3 * v)
}

fn place(z_m: f64, theta_rad: f64) -> String {
    format!("{z_m:.2} m, {:.0} deg", theta_rad.to_degrees())
}

fn p(p: f64) -> String {
    match p {
        p if p < 1e-6 => "p < 1e-6".into(),
        p if p < 0.01 => format!("p = {p:.0e}"),
        p => format!("p = {p:.2}"),
    }
}

fn report_effect(effect: &SharedEffect) {
    let lacks = match &effect.not_found_in[..] {
        [] => String::new(),
        units => format!("; not found in {}", units.join(", ")),
    };
    result(format!("{}: in {}{lacks}", effect.id, effect.found_in.join(", ")));
    for parameter in &effect.parameters {
        let one = |u: &ParameterOfUnit| {
            let error = u.std_error.filter(|s| *s > 0.0);
            let error =
                error.map_or(String::new(), |s| format!(" +- {}", shortest(to_digits(s, 2))));
            format!("{} {}{error}", u.unit, shortest(to_digits(u.value, 4)))
        };
        let units: Vec<String> = parameter.units.iter().map(one).collect();
        let shared = parameter.random_effects.map_or(String::new(), |r| {
            let [common, scatter] =
                [(r.common, 4), (r.scatter, 2)].map(|(v, digits)| shortest(to_digits(v, digits)));
            format!("; in common {common}, units scatter {scatter}")
        });
        let unit = Some(parameter.unit).filter(|u| !u.is_empty());
        let unit = unit.map_or(String::new(), |u| format!(", {u}"));
        result(format!("  {}{unit}: {}{shared}", parameter.name, units.join(", ")));
    }
}

fn report_change(change: &Change) {
    let day = |created: &str| created.split('T').next().unwrap_or_default().to_string();
    let of = |created: &str, file: &Path| format!("{} ({})", day(created), file.display());
    let [from, to] = [of(&change.from_created, &change.from), of(&change.to_created, &change.to)];
    result(format!("{}, {from} to {to}", change.unit));
    let verdict = |what: &str, changed: bool, p_adjusted: f64| {
        let verdict = if changed { "has changed" } else { "no change found" };
        result(format!("  {what}: {verdict} ({})", p(p_adjusted)));
    };
    verdict("sigma", change.sigma.changed, change.sigma.p_adjusted);
    for at in &change.sigma.places {
        let ([low, high], [from, to, by]) =
            (mm(at.interval_m), mm([at.from_m, at.to_m, at.change_m]));
        let moved = format!("{from:.2} to {to:.2} mm, {by:+.2} mm (95 %: {low:+.2} to {high:+.2})");
        result(format!("    {}: {moved}", place(at.z_m, at.theta_rad)));
    }
    if let Some(bias) = &change.bias {
        verdict("bias", bias.changed, bias.p_adjusted);
        for at in &bias.distances {
            let (z, [by, error]) = (at.z_m, mm([at.change_rms_m, at.error_rms_m]));
            result(format!("    {z:.2} m: by {by:.2} mm rms over the picture (error {error:.2})"));
        }
    }
    for (ids, when) in [(&change.found_now, "now"), (&change.found_then, "then")] {
        if !ids.is_empty() {
            result(format!("  found {when} only: {}", ids.join(", ")));
        }
    }
}
