use std::path::PathBuf;

use clap::Args;
use kinoise::fleet::{
    BiasOfUnit, Change, Comparison, ParameterOfUnit, SharedBias, SharedEffect, SharedSigma,
    Standing, UnitModel, compare,
};
use kinoise::units::counted;

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
    row("", &|i| format!("{:.2} m, {:.0} deg", at(i).z_m, at(i).theta_rad.to_degrees()));
    for (k, standing) in sigma.standings.iter().enumerate() {
        row(&standing.unit, &|i| {
            let unit = &at(i).units[k];
            format!("{:.3} +- {:.3}", 1e3 * unit.sigma_m, 1e3 * unit.std_error_m)
        });
    }
    row("in common", &|i| format!("{:.3}", 1e3 * at(i).common_m));
    row("  95 %", &|i| {
        let [low, high] = at(i).common_interval_m;
        format!("{:.3} to {:.3}", 1e3 * low, 1e3 * high)
    });
    row("units scatter", &|i| format!("{:.1} %", 1e2 * at(i).scatter));
    row("  95 %", &|i| {
        let [low, high] = at(i).scatter_interval;
        format!("{:.1} to {:.1}", 1e2 * low, 1e2 * high)
    });
    report_standings("sigma", &sigma.standings, &|k| {
        let departure = |i: &usize| at(*i).units[k].departure;
        let places = 0..sigma.places.len();
        let largest = places.max_by(|a, b| departure(a).abs().total_cmp(&departure(b).abs()));
        largest.map_or(String::new(), |i| {
            let ([low, high], place) = (at(i).units[k].departure_interval, at(i));
            format!(
                "{:+.0} % ({:+.0} to {:+.0}) at {:.2} m, {:.0} deg",
                1e2 * departure(&i),
                1e2 * low,
                1e2 * high,
                place.z_m,
                place.theta_rad.to_degrees()
            )
        })
    });
}

fn report_bias(bias: &SharedBias) {
    result("\nbias of depth over the picture, mm rms");
    for d in &bias.distances {
        let of = |u: &BiasOfUnit| {
            format!("{} {:.2} (error {:.2})", u.unit, 1e3 * u.rms_m, 1e3 * u.error_rms_m)
        };
        let units: Vec<String> = d.units.iter().map(of).collect();
        result(format!(
            "{:.2} m: in common {:.2}, units scatter {:.2}; {}",
            d.z_m,
            1e3 * d.common_rms_m,
            1e3 * d.scatter_rms_m,
            units.join(", ")
        ));
    }
    report_standings("bias", &bias.standings, &|k| {
        bias.distances.last().map_or(String::new(), |d| {
            format!("{:.2} mm rms off at {:.2} m", 1e3 * d.units[k].departure_rms_m, d.z_m)
        })
    });
}

/// Who shares it, and who has its own; `how_far` off the others a unit is.
fn report_standings(what: &str, standings: &[Standing], how_far: &dyn Fn(usize) -> String) {
    let names = |own: bool| -> Vec<&str> {
        standings.iter().filter(|s| s.is_own == own).map(|s| s.unit.as_str()).collect()
    };
    match names(false)[..] {
        [] => result(format!("no two units share a {what}: each needs its own model")),
        ref core => {
            result(format!("in common: {} share one {what} within the errors", core.join(", ")))
        }
    }
    for (k, s) in standings.iter().enumerate().filter(|(_, s)| s.is_own) {
        result(format!(
            "its own: {} has another {what}: {}, {}",
            s.unit,
            how_far(k),
            p(s.p_adjusted)
        ));
    }
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
            let error = error.map_or(String::new(), |s| format!(" +- {s:.2}"));
            format!("{} {:.3}{error}", u.unit, u.value)
        };
        let units: Vec<String> = parameter.units.iter().map(one).collect();
        let shared = parameter.random_effects.map_or(String::new(), |r| {
            format!("; in common {:.3}, units scatter {:.3}", r.common, r.scatter)
        });
        let unit = Some(parameter.unit).filter(|u| !u.is_empty());
        let unit = unit.map_or(String::new(), |u| format!(", {u}"));
        result(format!("  {}{unit}: {}{shared}", parameter.name, units.join(", ")));
    }
}

fn report_change(change: &Change) {
    let day = |created: &str| created.split('T').next().unwrap_or_default().to_string();
    let span = format!(
        "{}, {} ({}) to {} ({})",
        change.unit,
        day(&change.from_created),
        change.from.display(),
        day(&change.to_created),
        change.to.display()
    );
    result(span);
    let sigma = &change.sigma;
    let verdict = |changed: bool| if changed { "has changed" } else { "no change found" };
    let places = sigma.places.iter().map(|at| {
        let [low, high] = at.interval_m;
        format!(
            "    {:.2} m, {:.0} deg: {:.2} to {:.2} mm, {:+.2} mm (95 %: {:+.2} to {:+.2})",
            at.z_m,
            at.theta_rad.to_degrees(),
            1e3 * at.from_m,
            1e3 * at.to_m,
            1e3 * at.change_m,
            1e3 * low,
            1e3 * high
        )
    });
    result(format!("  sigma: {} ({})", verdict(sigma.changed), p(sigma.p_adjusted)));
    places.for_each(result);
    if let Some(bias) = &change.bias {
        result(format!("  bias: {} ({})", verdict(bias.changed), p(bias.p_adjusted)));
        for at in &bias.distances {
            result(format!(
                "    {:.2} m: by {:.2} mm rms over the picture (error {:.2})",
                at.z_m,
                1e3 * at.change_rms_m,
                1e3 * at.error_rms_m
            ));
        }
    }
    for (ids, when) in [(&change.found_now, "now"), (&change.found_then, "then")] {
        if !ids.is_empty() {
            result(format!("  found {when} only: {}", ids.join(", ")));
        }
    }
}
