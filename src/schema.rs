//! JSON Schemas of the files that others read: `model.json`, `diagnosis.json`, and the rows of
//! `measurements.csv`.

use schemars::{JsonSchema, Schema, schema_for};

use crate::diagnose::Diagnosis;
use crate::model::model_schema;

/// A file with a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SchemaOf {
    Model,
    Diagnosis,
    /// Each row is an object keyed by the names of the header; an empty field is null.
    Measurements,
}

/// JSON Schema, draft 2020-12.
pub fn schema(of: SchemaOf) -> Schema {
    match of {
        SchemaOf::Model => model_schema(),
        SchemaOf::Diagnosis => schema_for!(Diagnosis),
        SchemaOf::Measurements => schema_for!(Vec<MeasurementsRow>),
    }
}

/// A row of `measurements.csv`: a cell, which is a view, or a bin of depth within a view that is
/// strongly tilted.
#[derive(JsonSchema)]
#[allow(dead_code)] // Describes the rows, which `measure::write_measurements` writes.
struct MeasurementsRow {
    /// The view's name.
    view: String,
    /// Mean depth of the cell, m.
    z_m: f64,
    /// Between the optical axis and the plane's normal, rad.
    theta_rad: f64,
    /// Direction in the image in which depth grows, 0 along the columns, rad.
    azimuth_rad: f64,
    /// Spatial sigma: over the pixels of one frame, along the optical axis, m.
    sigma_m: f64,
    /// Its standard error, m.
    sigma_std_error_m: Option<f64>,
    /// Of one pixel over the frames, m.
    sigma_temporal_m: Option<f64>,
    /// Pixels, over all frames.
    n: u64,
    /// Independent samples among them.
    n_effective: f64,
    /// Over pixels and frames, m.
    sigma_total_m: Option<f64>,
    /// Across the plane, m.
    sigma_perpendicular_m: Option<f64>,
    /// Pixels without depth.
    missing: u64,
    /// Pixels beyond 3.5 sigma, left out.
    cut: u64,
    /// Mean depth of the whole view, m.
    view_z_m: f64,
    /// Spatial sigma of the whole view, m.
    view_sigma_m: f64,
    /// Depth of the plane on the optical axis, m.
    axis_distance_m: f64,
    /// As `view.json` gives it, m.
    reference_distance_m: Option<f64>,
    /// The paper's method: RANSAC on the first frame, m.
    paper_z_m: Option<f64>,
    /// Of that plane, rad.
    paper_theta_rad: Option<f64>,
    /// Point-to-plane distances of its inliers, m.
    paper_sigma_m: Option<f64>,
    /// Length over which neighbouring pixels err together, px.
    correlation_px: Option<f64>,
    /// Of a pixel with itself one frame later.
    temporal_correlation: Option<f64>,
    /// Mean amplitude of the target, in the image's own units.
    infrared: Option<f64>,
    /// Of the first frame, s.
    time_s: f64,
    /// `sigma_m` in px of disparity, where the sensor has a disparity.
    sigma_px: Option<f64>,
    /// Standard error of `axis_distance_m`, from the scatter of the readings, m.
    axis_std_error_m: f64,
    /// Of `reference_distance_m`, as `view.json` gives it, m.
    reference_uncertainty_m: Option<f64>,
    /// Combined standard uncertainty of axis_distance_m - reference_distance_m, m.
    distance_error_uncertainty_m: Option<f64>,
    /// Its effective degrees of freedom; empty where they are infinite.
    distance_error_degrees_of_freedom: Option<f64>,
    /// Its expanded uncertainty, k = 2, m.
    distance_error_expanded_m: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::write_measurements;

    #[test]
    fn a_row_has_the_columns_of_the_table() {
        let schema = serde_json::to_value(schema_for!(MeasurementsRow)).expect("JSON");
        let mut described: Vec<&String> =
            schema["properties"].as_object().expect("columns").keys().collect();
        let header = write_measurements(&[]);
        let mut columns: Vec<String> = header.trim_end().split(',').map(String::from).collect();
        described.sort();
        columns.sort();
        assert_eq!(described, columns.iter().collect::<Vec<_>>());
    }
}
