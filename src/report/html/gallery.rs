//! Every view's residual, to see what a number cannot say: bands, bowls, edges.

use maud::{Markup, html};

use crate::error::Result;
use crate::measure::ViewMeasurement;
use crate::report::axis::Axis;
use crate::report::base64;
use crate::report::numbers::{degrees, fixed, millimetres};
use crate::report::residual_picture::{residual_png, scale_mm};

pub(super) fn section(views: &[ViewMeasurement]) -> Result<Markup> {
    let pictures = views.iter().map(picture).collect::<Result<Vec<Markup>>>()?;
    Ok(html! {
        section {
            h2 { "Residuals" }
            p {
                "Mean depth minus the plane, along the optical axis. Blue is nearer than the plane, red farther, \
                 grey is not the target. Each picture has its own scale."
            }
            div.gallery { @for picture in pictures { (picture) } }
        }
    })
}

fn picture(view: &ViewMeasurement) -> Result<Markup> {
    let scale = scale_mm(&view.picture);
    let png = base64::encode(&residual_png(&view.picture, scale)?);
    let end = Axis::label(scale);
    Ok(html! {
        figure {
            img alt={ "residual of view " (view.name) } width=(view.picture.width)
                height=(view.picture.height) src={ "data:image/png;base64," (png) };
            div.scale { span { "−" (end) } span { "0" } span { "+" (end) " mm" } }
            figcaption {
                b { (view.name) } br;
                (fixed(view.z_m, 2)) " m, " (degrees(view.theta_rad)) "°, σ "
                (millimetres(view.whole.spread.spatial_m)) " mm"
            }
        }
    })
}
