//! The map to look at from all sides: one self-contained page with points and path, drawn by WebGL.

use maud::html;

use super::document::base64;
use crate::map::{FrameReport, MapPoint};
use crate::stats::range;

/// More points make the page heavy and the map no clearer.
const MAX_POINTS: usize = 250_000;
/// Colours show sigma between these, m, on a logarithmic scale.
const SIGMA_M: [f32; 2] = [0.0005, 0.05];
/// Places are stored in 16 bits over the map's extent.
const STEPS: f64 = 65_535.0;

/// The page as text.
pub fn map_page(title: &str, points: &[MapPoint], frames: &[FrameReport]) -> String {
    let stride = points.len().div_ceil(MAX_POINTS).max(1);
    let shown: Vec<&MapPoint> =
        points.iter().step_by(stride).filter(|p| p.at.iter().all(|v| v.is_finite())).collect();
    let extents = [0, 1, 2].map(|k| range(shown.iter().map(|p| p.at[k].into())));
    let places = frames.iter().filter_map(|f| Some(f.pose?.translation));
    let path: Vec<String> = places.map(|t| format!("{:.3},{:.3},{:.3}", t.x, t.y, t.z)).collect();
    include_str!("map_page.html")
        .replace("{{title}}", &html! { (title) }.into_string())
        .replace("{{count}}", &shown.len().to_string())
        .replace("{{low}}", &numbers(extents.map(|e| e[0])))
        .replace("{{high}}", &numbers(extents.map(|e| e[1])))
        .replace("{{path}}", &path.join(","))
        .replace("{{points}}", &base64(&packed(&shown, extents)))
}

fn numbers(v: [f64; 3]) -> String {
    v.map(|v| if v.is_finite() { (v as f32).to_string() } else { "0".into() }).join(",")
}

/// Ten bytes a point: three places in 16 bits, red, green, blue, sigma.
fn packed(points: &[&MapPoint], extents: [[f64; 2]; 3]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(points.len() * 10);
    let decades = (SIGMA_M[1] / SIGMA_M[0]).ln();
    for point in points {
        for (at, [low, high]) in point.at.iter().zip(extents) {
            let share = (f64::from(*at) - low) / (high - low).max(f64::MIN_POSITIVE);
            bytes.extend_from_slice(&((share * STEPS).round() as u16).to_le_bytes());
        }
        bytes.extend_from_slice(&point.colour);
        let share = (point.sigma / SIGMA_M[0]).ln() / decades;
        bytes.push((share.clamp(0.0, 1.0) * 255.0).round() as u8);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_page_is_whole_and_carries_every_point() {
        let point = |k: usize| MapPoint {
            at: Vector3::new(k as f32, 0.5, 2.0),
            normal: Vector3::z(),
            sigma: 0.002,
            colour: [k as u8; 3],
        };
        let page = map_page("a <b>", &(0..10).map(point).collect::<Vec<_>>(), &[]);
        assert!(page.contains("a &lt;b&gt;") && !page.contains("{{"));
        assert!(!page.contains("http"), "self-contained");
        assert!(page.ends_with("</html>\n"));
        assert!(!map_page("nothing", &[], &[]).contains("inf"), "an empty map makes a page too");
    }
}
