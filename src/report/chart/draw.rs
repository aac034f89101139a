//! Draws SVG and PNG from the same shapes.

use std::io::Cursor;
use std::sync::OnceLock;

use image::imageops::{FilterType, resize};
use image::{ImageFormat, RgbImage};
use maud::html;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::register_font;
use plotters::style::text_anchor::{Pos, VPos};

use super::Chart;
use super::shapes::{FONT, Point, Shape};
use crate::error::{Error, Result};

/// PNG pixels per unit after downscaling ...
const PNG_SCALE: u32 = 2;
/// ... by this factor, which smooths the jagged edges of plotters' bitmaps.
const OVERSAMPLING: u32 = 2;
/// Downward shift of PNG text, units: plotters' bitmap backend centres the line box, not the letters.
const PNG_TEXT_DROP: f64 = 2.0;
/// Radius of a tip's hover area, units: large enough for a finger, small enough to separate neighbours.
const TIP: i32 = 8;

impl Chart {
    /// The chart as SVG text, with its tips.
    pub fn svg(&self) -> Result<String> {
        let mut text = String::new();
        self.draw_on(SVGBackend::with_string(&mut text, self.size), 1, 0.0)?;
        let tip = |([x, y], words): ([f64; 2], &str)| {
            let [x, y] = [x, y].map(|v| v.round() as i32);
            html! { circle.tip cx=(x) cy=(y) r=(TIP) fill="transparent" { title { (words) } } }
        };
        let tips = self.tip_places().into_iter().map(|place| tip(place).into_string());
        Ok(text.replace("</svg>", &(tips.collect::<String>() + "</svg>")))
    }

    /// The chart as the bytes of a PNG.
    pub fn png(&self) -> Result<Vec<u8>> {
        let scale = PNG_SCALE * OVERSAMPLING;
        let (width, height) = (self.size.0 * scale, self.size.1 * scale);
        let mut image = RgbImage::new(width, height);
        let backend = BitMapBackend::with_buffer(&mut image, (width, height));
        self.draw_on(backend, scale, PNG_TEXT_DROP)?;
        let (width, height) = (width / OVERSAMPLING, height / OVERSAMPLING);
        let small = resize(&image, width, height, FilterType::Triangle);
        let mut bytes = Vec::new();
        small.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).map_err(failed)?;
        Ok(bytes)
    }

    /// Draws with `unit` px for each px of the SVG.
    fn draw_on<B: DrawingBackend>(&self, backend: B, unit: u32, text_drop: f64) -> Result<()> {
        if !font_registered() {
            return Err(failed("the built-in font is damaged"));
        }
        let root = backend.into_drawing_area();
        let scale = unit as i32;
        let px = |[u, v]: Point| {
            let [u, v] = [u, v].map(|x| (x * f64::from(unit)).round() as i32);
            (u, v)
        };
        let all = |points: Vec<Point>| points.into_iter().map(px).collect::<Vec<_>>();
        let draw = |shape: Shape| match shape {
            Shape::Line(points, stroke) => {
                let style = stroke.colour.stroke_width(stroke.width * unit);
                match stroke.dashes.map(|lengths| lengths.map(|length| length * scale)) {
                    Some([dash, gap]) => {
                        root.draw(&DashedPathElement::new(all(points), dash, gap, style))
                    }
                    None => root.draw(&PathElement::new(all(points), style)),
                }
            }
            Shape::Area(outline, colour) => root.draw(&Polygon::new(all(outline), colour)),
            Shape::Box(corners, colour) => {
                root.draw(&Rectangle::new(corners.map(px), colour.filled()))
            }
            Shape::Disc(at, mark) => {
                let (at, radius) = (px(at), mark.radius * scale);
                root.draw(&Circle::new(at, radius, mark.fill.filled()))?;
                root.draw(&Circle::new(at, radius, mark.edge.stroke_width(unit)))
            }
            Shape::Text(text, [u, v], anchor, size, colour) => {
                let font = (FONT, size * scale).into_text_style(&root);
                let style = font.color(&colour).pos(Pos::new(anchor, VPos::Center));
                root.draw_text(&text, &style, px([u, v + text_drop]))
            }
        };
        root.fill(&WHITE).map_err(failed)?;
        self.shapes().into_iter().try_for_each(draw).map_err(failed)?;
        root.present().map_err(failed)
    }
}

fn failed(why: impl std::fmt::Display) -> Error {
    Error::Drawing { what: "a chart", why: why.to_string() }
}

fn font_registered() -> bool {
    static DONE: OnceLock<bool> = OnceLock::new();
    *DONE.get_or_init(|| {
        let bytes = include_bytes!("../fonts/kinoise-sans.ttf");
        register_font(FONT, FontStyle::Normal, bytes).is_ok()
    })
}
