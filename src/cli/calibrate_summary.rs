//! A calibration as a few lines of text and as JSON.

use std::fmt::Write as _;

use kinoise::calibrate::Measurements;
use kinoise::units::{counted, decimals};
use kinoise::{Calibration, SigmaModel};
use serde_json::{Map, Value, json};

/// The fit: the formula, its parameters and the quality of the fit.
pub fn formula(calibration: &Calibration) -> String {
    let fit = &calibration.fit;
    let mut text = format!("{}\n", fit.form.card().formula);
    for p in &fit.parameters {
        let value = three_digits_like(p.value, p.std_error);
        let error = p.std_error.map_or("held".into(), |e| format!("± {}", three_digits(e)));
        let _ = writeln!(text, "  {:<3}= {value:>12}  {error}", p.name);
    }
    let [rows, views] = [counted(fit.rows, "sigma"), counted(fit.views, "view")];
    let r2 = fit.quality.r2;
    let (rmse_mm, share) = (1e3 * fit.quality.rmse_m, 1e2 * fit.quality.rmse_relative);
    let rmse = format!("rmse {rmse_mm:.2} mm ({share:.1} % of sigma), r2 {r2:.4}");
    let heldout = calibration.comparison.iter().find(|h| h.form == fit.form);
    let heldout =
        heldout.map(|h| format!("; {:.1} % at distances left out", 1e2 * h.rmse_relative));
    text + &format!("fitted to {rows} of {views}: {rmse}{}", heldout.unwrap_or_default())
}

/// Table of sigma beside the published models, and the comparison of the forms.
pub fn comparison(calibration: &Calibration) -> String {
    let mut text = surface(&calibration.model.sigma).map_or(String::new(), |s| format!("\n{s}"));
    if calibration.comparison.len() > 1 {
        text += "\nhow each form predicts distances left out (error of sigma, log score a view):\n";
        for h in &calibration.comparison {
            let (form, error) = (h.form.id(), 1e2 * h.rmse_relative);
            let _ = writeln!(text, "  {form:<11}{error:>7.1} %{:>9.2}", h.log_score);
        }
    }
    text
}

/// Table of sigma in mm on a small grid inside the valid domain, beside the published models; `None` where
/// the domain contains no grid point.
fn surface(model: &SigmaModel) -> Option<String> {
    let mut rows = String::new();
    let head = " z (m)  tilt   this sensor (95 %)       paper Eq. 1  Nguyen 2012  Khoshelham 2012   sigma in mm\n";
    for z in shown_distances(model) {
        for theta_deg in [0.0f64, 30.0, 60.0, 75.0] {
            let theta = theta_deg.to_radians();
            let [low, high] = model.domain.theta_rad;
            // A frontal view is never exactly frontal.
            if theta > high || (theta < low - 0.1) {
                continue;
            }
            let [a, b] = model.interval(z, theta, 0.95);
            let [sigma, a, b] = [model.sigma(z, theta), a, b].map(millimetres);
            let own = format!("{sigma} ({a}-{b})");
            let models = [SigmaModel::paper(), SigmaModel::nguyen(), SigmaModel::khoshelham()];
            let [paper, nguyen, khoshelham] = models.map(|model| published(&model, z, theta));
            let _ = writeln!(
                rows,
                "{z:>6.2}{theta_deg:>5.0}°   {own:<24}{paper:>10}{nguyen:>13}{khoshelham:>13}"
            );
        }
    }
    const ABSENT: &str = "    -: its authors measured no such distance or tilt\n";
    (!rows.is_empty()).then(|| format!("{head}{rows}{ABSENT}"))
}

fn millimetres(metres: f64) -> String {
    decimals(1e3 * metres, 2)
}

/// The sigma of a published model in mm, or a dash outside the range that its authors measured.
fn published(model: &SigmaModel, z: f64, theta: f64) -> String {
    if model.domain.contains(z, theta) { millimetres(model.sigma(z, theta)) } else { "-".into() }
}

/// Round distances inside the domain, or its middle if it contains none.
fn shown_distances(model: &SigmaModel) -> Vec<f64> {
    let [low, high] = model.domain.z_m;
    let round: Vec<f64> =
        [0.5, 1.0, 2.0, 3.0, 4.0, 6.0].into_iter().filter(|z| (low..=high).contains(z)).collect();
    if round.is_empty() { vec![0.5 * (low + high)] } else { round }
}

fn three_digits(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return format!("{v}");
    }
    let magnitude = v.abs().log10().floor();
    if (-4.0..4.0).contains(&magnitude) {
        format!("{v:.*}", (2.0 - magnitude).max(0.0) as usize)
    } else {
        format!("{v:.2e}")
    }
}

/// Formats `v` with as many digits as its error warrants.
fn three_digits_like(v: f64, error: Option<f64>) -> String {
    match error {
        Some(e) if e > 0.0 && e.is_finite() && v.abs() >= 1e-4 => {
            let digits = (1.0 - e.log10().floor()).clamp(0.0, 9.0) as usize;
            format!("{v:.digits$}")
        }
        _ => three_digits(v),
    }
}

/// The result as JSON.
pub fn as_json(calibration: &Calibration, measurements: Option<&Measurements>) -> Value {
    let fit = &calibration.fit;
    let parameters = fit.parameters.iter().map(|p| {
        (p.name.into(), json!({"value": p.value, "std_error": p.std_error, "remark": p.remark}))
    });
    let mut value = json!({
        "form": fit.form.id(),
        "parameters": parameters.collect::<Map<String, Value>>(),
        "valid": {"z_m": fit.domain.z_m, "theta_rad": fit.domain.theta_rad},
        "rows": fit.rows,
        "rmse_m": fit.quality.rmse_m,
        "rmse_relative": fit.quality.rmse_relative,
        "r2": fit.quality.r2,
        "comparison": calibration.comparison.iter().map(|h| json!({
            "form": h.form.id(), "log_score": h.log_score, "rmse_relative": h.rmse_relative,
        })).collect::<Vec<_>>(),
        "warnings": calibration.warnings,
    });
    if let Some(m) = measurements {
        value["views"] = m.views.iter().map(|v| json!({
            "view": v.name,
            "z_m": v.z_m,
            "axis_distance_m": v.axis_distance_m,
            "reference_distance_m": v.reference_distance_m,
            "off_reference_m": v.reference().map(|r| r.off_m()),
            "off_reference_expanded_m": v.distance_budget.as_ref().map(|b| b.expanded_m),
            "theta_rad": v.theta_rad,
            "azimuth_rad": v.azimuth_rad,
            "sigma_m": v.whole.spread.spatial_m,
            "sigma_px": v.sigma_px(&v.whole),
            "sigma_std_error_m": v.whole.std_error_m,
            "sigma_temporal_m": v.whole.spread.temporal_m,
            "sigma_total_m": v.whole.spread.total_m,
            "frames": v.frames,
            "n": v.whole.n,
            "n_effective": v.whole.n_effective,
            "paper": v.paper.map(|p| json!({"z_m": p.z_m, "theta_rad": p.theta_rad, "sigma_m": p.sigma_m})),
            "notes": v.notes,
        })).collect();
        value["excluded"] =
            m.excluded.iter().map(|e| json!({"view": e.view, "reason": e.reason})).collect();
    }
    value
}
