//! Models, diagnoses, tables of sigma, and the map's points.

use std::fmt::Write;

use kinoise::capture::Wanted;
use kinoise::correct::{Conditions, Correction};
use kinoise::map::{MapPoint, ply as ply_of};
use kinoise::measure::{SigmaTable, read_table};
use kinoise::simulate::kinect_v1;
use kinoise::{CalibrateOptions, Form, NoiseModel, SigmaModel, model_of_table};
use nalgebra::Vector3;

use super::desk::Desk;

thread_local! {
    static DESK: Desk = Desk::new(&[]);
}

/// model.json, and its correction of depths.
pub fn model(data: &[u8]) -> bool {
    DESK.with(|desk| {
        let Ok(model) = NoiseModel::read(&desk.put("model.json", data)) else {
            return false;
        };
        let text = model.to_json().expect("what was read is written");
        let again = NoiseModel::read(&desk.put("again.json", text.as_bytes()));
        assert_eq!(again.expect("what was written is read"), model);
        check_sigma(&model.sigma);
        let own = model.described_sensor().expect("its sensor was read");
        let sensor = own.filter(|s| s.camera.pixels() <= 4096).unwrap_or_else(|| kinect_v1(16));
        let Ok(correction) = Correction::of(&model, &sensor) else { return true };
        for (session_s, temperature_c) in [(0.0, None), (600.0, Some(30.0))] {
            let conditions = Conditions { session_s, temperature_c, ambient_lux: Some(100.0) };
            let depths = [0.4, 2.0, 9.0].map(|z| vec![z; sensor.camera.pixels()]);
            for stored in depths {
                let corrected = correction.corrected(&stored, &conditions).expect("its size");
                assert!(corrected.iter().all(|z| *z > 0.0), "{:?}", corrected.first());
                let sigma = correction.sigma_m(&stored, &conditions).expect("its size");
                for (sigma, z) in sigma.iter().zip(&corrected) {
                    assert!(!z.is_finite() || *sigma > 0.0, "sigma {sigma} at {z} m");
                }
                if correction.knows_uncertainty() {
                    let sure = correction.uncertainty_m(&stored, &conditions).expect("its size");
                    assert!(sure.iter().all(|u| *u >= 0.0), "{:?}", sure.first());
                }
            }
        }
        true
    })
}

fn check_sigma(sigma: &SigmaModel) {
    for z in [0.01, 0.5, 1.0, 3.0, 10.0, 99.0] {
        for theta in [0.0, 0.5, 1.2, 1.57] {
            let along = [sigma.sigma(z, theta), sigma.axial_sigma(z, theta)];
            assert!(along.iter().all(|s| s.is_finite() && *s > 0.0), "{along:?}, {z} m, {theta}");
            let interval = sigma.interval(z, theta, 0.95);
            assert!(interval.iter().all(|s| *s >= 0.0), "{interval:?} at {z} m, {theta}");
        }
    }
}

/// The views that a diagnosis.json asks for.
pub fn diagnosis(data: &[u8]) -> bool {
    DESK.with(|desk| {
        let Ok(wanted) = Wanted::advised(&desk.put("diagnosis.json", data)) else {
            return false;
        };
        assert!(!wanted.views.is_empty());
        for (k, view) in wanted.views.iter().enumerate() {
            let pose = [view.pose.z_m, view.pose.theta_rad, view.pose.azimuth_rad];
            assert!(pose.iter().all(|v| v.is_finite()) && !view.name.is_empty(), "{view:?}");
            assert!(!view.name.contains('/'), "{}", view.name);
            assert!(wanted.views[..k].iter().all(|v| v.name != view.name), "{}", view.name);
        }
        true
    })
}

/// Maximum number of rows to which models are fitted.
const MAX_ROWS: usize = 48;

/// The table that `fit` reads, written and fitted.
pub fn table(data: &[u8]) -> bool {
    DESK.with(|desk| {
        let path = desk.put("table.csv", data);
        let Ok(table) = read_table(&path) else { return false };
        let mut text = String::from("z_m,theta_rad,sigma_m,n_effective,view\n");
        for row in &table.rows {
            let n = row.n_effective.map_or(String::new(), |n| n.to_string());
            let (z, theta, sigma, view) = (row.z_m, row.theta_rad, row.sigma_m, row.view);
            let _ = writeln!(text, "{z},{theta},{sigma},{n},{view}");
        }
        let again = read_table(&desk.put("again.csv", text.as_bytes()));
        assert_eq!(numbered(again.expect("what was written is read")), numbered(table.clone()));
        if table.rows.len() > MAX_ROWS {
            return true;
        }
        for form in [None, Some(Form::Paper)] {
            let options = CalibrateOptions { form, ..CalibrateOptions::default() };
            let Ok(fitted) = model_of_table(&table, &path, &options) else { continue };
            // A model that cannot be written is refused there; one that is written can be read.
            let Ok(text) = fitted.model.to_json() else { continue };
            let read = NoiseModel::read(&desk.put("model.json", text.as_bytes()));
            check_sigma(&read.expect("what was written is read").sigma);
        }
        true
    })
}

/// Renumbers the views in the order of their rows.
fn numbered(mut table: SigmaTable) -> SigmaTable {
    let mut seen = Vec::new();
    for row in &mut table.rows {
        let at = seen.iter().position(|v| *v == row.view).unwrap_or(seen.len());
        if at == seen.len() {
            seen.push(row.view);
        }
        row.view = at;
    }
    table
}

/// Bytes per point in the file: seven floats and three bytes of colour.
const POINT: usize = 31;
const FLOATS: [usize; 7] = [0, 4, 8, 12, 16, 20, 27];

/// The bytes are points; the PLY file has them unchanged after a header with their number.
pub fn ply(data: &[u8]) -> bool {
    let points: Vec<MapPoint> = data.chunks_exact(POINT).map(point).collect();
    let file = ply_of(&points);
    let end = b"end_header\n";
    let body = file.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let header = std::str::from_utf8(&file[..body]).expect("text");
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
    assert!(header.contains(&format!("element vertex {}\n", points.len())), "{header}");
    let properties = |kind: &str| header.matches(&format!("property {kind} ")).count();
    assert_eq!((properties("float"), properties("uchar")), (FLOATS.len(), 3));
    assert_eq!(&file[body..], &data[..points.len() * POINT]);
    !points.is_empty()
}

fn point(bytes: &[u8]) -> MapPoint {
    let float = |k: usize| {
        let at = FLOATS[k];
        f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
    };
    MapPoint {
        at: Vector3::new(float(0), float(1), float(2)),
        normal: Vector3::new(float(3), float(4), float(5)),
        colour: [bytes[24], bytes[25], bytes[26]],
        sigma: float(6),
    }
}
