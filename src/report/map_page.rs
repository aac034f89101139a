//! The interactive map page: surfels and path drawn by WebGL, and the errors of the path.

mod scene;

use maud::{Markup, PreEscaped, html};

use super::document::{Origin, document, section, tiles};
use super::numbers::{ABSENT, fixed};
use super::trajectories::Against;
use crate::error::Result;
use crate::map::{FrameReport, MapPoint};
use crate::stats::{quantile, range};

/// Most points drawn, 13 bytes each; more make the page heavy and the map no clearer.
const MAX_POINTS: usize = 500_000;
const SCRIPT: &str = include_str!("map_page.js");

/// Contents of the page.
#[derive(Debug, Clone, Copy)]
pub struct MapPage<'a> {
    pub title: &'a str,
    pub points: &'a [MapPoint],
    pub frames: &'a [FrameReport],
    /// Comparison with the true poses, if the sequence has them.
    pub against: Option<Against<'a>>,
    /// Name of the model whose sigma weighs the points.
    pub model: &'a str,
    pub origin: &'a Origin,
}

/// Renders the page as HTML text.
pub fn map_page(page: &MapPage<'_>) -> Result<String> {
    let stride = page.points.len().div_ceil(MAX_POINTS).max(1);
    let finite = |p: &&MapPoint| p.at.iter().all(|v| v.is_finite());
    let shown: Vec<&MapPoint> = page.points.iter().step_by(stride).filter(finite).collect();
    let errors = page.against.map(|against| against.parts()).transpose()?;
    let body = html! {
        h1 { (page.title) }
        div.world {
            canvas #view role="img" aria-label="the map as discs, and the camera's path" {}
            svg #over aria-hidden="true" {}
        }
        p #no-webgl hidden { "This browser has no WebGL; open map.ply in MeshLab or CloudCompare instead." }
        div.controls {
            button #mode type="button" { "show σ" } button #path type="button" { "hide path" }
            button #home type="button" { "first view" }
            label.when { "time " input #when type="range" min="0" value="0" step="1" {} output #stamp {} }
            div.sigmas #sigmas hidden {}
        }
        p.note {
            "Drag to turn, shift or right drag to move, wheel or two fingers to zoom. Each disc lies along the surface \
             and is as wide as points are apart. The bar is true at the middle of the map; x right, y down, z \
             forward in the first camera. σ: of a point along its normal."
        }
        (numbers_of(page, shown.len()))
        @if let Some(errors) = errors { (errors) } @else {
            (section("Errors", &html! { p { "The sequence has no true poses to compare with." } }))
        }
        script type="application/json" id="map-data" { (PreEscaped(scene::data(&shown, page.frames, page.against.as_ref()))) }
        script { (PreEscaped(SCRIPT)) }
    };
    let model = ("model".to_string(), html! { (page.model) });
    Ok(document(page.title, page.origin, &[model], &body).into_string())
}

fn numbers_of(page: &MapPage<'_>, shown: usize) -> Markup {
    let posed = page.frames.iter().filter(|f| f.pose.is_some()).count();
    let stamps = range(page.frames.iter().map(|f| f.stamp));
    let lasts = stamps[1] - stamps[0];
    let seconds = if lasts >= 0.0 { format!("{} s", fixed(lasts, 1)) } else { ABSENT.into() };
    let mut sigmas: Vec<f64> = page.points.iter().map(|p| f64::from(p.sigma)).collect();
    let median = quantile(&mut sigmas, 0.5);
    let median = median.map_or(ABSENT.into(), |s| format!("{} mm", fixed(1e3 * s, 2)));
    let drawn = match shown == page.points.len() {
        true => "all are drawn".to_string(),
        false => format!("{shown} of them are drawn; map.ply has all"),
    };
    tiles([
        ("frames with a pose", format!("{posed} of {}", page.frames.len()), seconds),
        ("points", page.points.len().to_string(), drawn),
        ("σ of a point", median, "median, along its normal".into()),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use serde_json::json;

    #[test]
    fn the_page_is_whole_and_carries_every_point() {
        let point = |k: usize| MapPoint {
            at: Vector3::new(k as f32, 0.5, 2.0),
            normal: Vector3::z(),
            sigma: 0.002,
            colour: [k as u8; 3],
        };
        let points: Vec<MapPoint> = (0..10).map(point).collect();
        let origin = &Origin::default();
        let full = MapPage {
            title: "a <b>",
            points: &points,
            frames: &[],
            against: None,
            model: "Eq. 1",
            origin,
        };
        let page = map_page(&full).unwrap();
        assert!(page.contains("a &lt;b&gt;") && page.contains("\"sigma\":[0.002"));
        assert!(!page.contains("http:") && !page.contains("https:"), "self-contained");
        assert!(
            page.contains("2.00 mm")
                && page.contains("<dd>Eq. 1</dd>")
                && page.ends_with("</html>")
        );
        let empty = map_page(&MapPage { points: &[], ..full }).unwrap();
        let data = empty.split_once("id=\"map-data\">").and_then(|(_, rest)| rest.split_once('<'));
        let data: serde_json::Value = serde_json::from_str(data.unwrap().0).unwrap();
        assert_eq!(data["low"], json!([0.0, 0.0, 0.0]), "an empty map makes a page too");
    }
}
