//! The map to turn in the hand: one self-contained page with points and path, drawn by WebGL.

use crate::map::{FrameReport, MapPoint};

use super::base64::encode;

/// More points make the page heavy and the map no clearer.
const MAX_POINTS: usize = 250_000;
/// Sigma is told apart between these, m, on a logarithmic scale.
const SIGMA_M: [f32; 2] = [0.0005, 0.05];
/// Places are stored in 16 bits over the map's extent.
const STEPS: f32 = 65_535.0;

/// The page as text.
pub fn map_page(title: &str, points: &[MapPoint], frames: &[FrameReport]) -> String {
    let stride = points.len().div_ceil(MAX_POINTS).max(1);
    let shown: Vec<&MapPoint> =
        points.iter().step_by(stride).filter(|p| p.at.iter().all(|v| v.is_finite())).collect();
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for point in &shown {
        for k in 0..3 {
            low[k] = low[k].min(point.at[k]);
            high[k] = high[k].max(point.at[k]);
        }
    }
    let path: Vec<String> = frames
        .iter()
        .filter_map(|f| f.pose)
        .map(|p| {
            let t = p.translation.vector;
            format!("{:.3},{:.3},{:.3}", t.x, t.y, t.z)
        })
        .collect();
    include_str!("map_page.html")
        .replace("{{title}}", &escaped(title))
        .replace("{{count}}", &shown.len().to_string())
        .replace("{{low}}", &numbers(low))
        .replace("{{high}}", &numbers(high))
        .replace("{{sigma}}", &numbers3(SIGMA_M))
        .replace("{{path}}", &path.join(","))
        .replace("{{points}}", &encode(&packed(&shown, low, high)))
}

fn numbers(v: [f32; 3]) -> String {
    v.map(|v| if v.is_finite() { v.to_string() } else { "0".into() }).join(",")
}

fn numbers3(v: [f32; 2]) -> String {
    v.map(|v| v.to_string()).join(",")
}

/// Ten bytes a point: three places in 16 bits, red, green, blue, sigma.
fn packed(points: &[&MapPoint], low: [f32; 3], high: [f32; 3]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(points.len() * 10);
    let decades = (SIGMA_M[1] / SIGMA_M[0]).ln();
    for point in points {
        for k in 0..3 {
            let share = (point.at[k] - low[k]) / (high[k] - low[k]).max(f32::MIN_POSITIVE);
            bytes.extend_from_slice(&((share * STEPS).round() as u16).to_le_bytes());
        }
        bytes.extend_from_slice(&point.colour);
        let share = (point.sigma / SIGMA_M[0]).ln() / decades;
        bytes.push((share.clamp(0.0, 1.0) * 255.0).round() as u8);
    }
    bytes
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
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
    }

    #[test]
    fn an_empty_map_makes_a_page_too() {
        assert!(!map_page("nothing", &[], &[]).contains("inf"));
    }
}
