//! Marks that tell groups apart without colour.

use plotters::prelude::*;

use crate::report::sheet::{Drawn, Pixel, Sheet};

/// The group's shape around `at`, filled and edged.
pub(super) fn draw_mark<B: DrawingBackend>(
    sheet: &Sheet<'_, B>,
    at: Pixel,
    group: usize,
    radius: i32,
    [fill, edge]: [ShapeStyle; 2],
) -> Drawn<B> {
    let Some(shape) = group.checked_sub(1).map(|i| SHAPES[i % SHAPES.len()]) else {
        sheet.root.draw(&Circle::new(at, radius, fill))?;
        return sheet.root.draw(&Circle::new(at, radius, edge));
    };
    let along = |share: f64| (share * f64::from(radius)).round() as i32;
    let mut corners: Vec<Pixel> =
        shape.iter().map(|(u, v)| (at.0 + along(*u), at.1 + along(*v))).collect();
    sheet.root.draw(&Polygon::new(corners.clone(), fill))?;
    corners.push(corners[0]);
    sheet.line(&corners, edge, &[])
}

/// Corners of the markers after the first (a disc), in units of the radius.
const SHAPES: [&[(f64, f64)]; 6] = [
    &[(-0.85, -0.85), (0.85, -0.85), (0.85, 0.85), (-0.85, 0.85)],
    &[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)],
    &[(0.0, -1.3), (1.1, 0.0), (0.0, 1.3), (-1.1, 0.0)],
    &[(0.0, 1.2), (1.1, -0.8), (-1.1, -0.8)],
    &[
        (-0.4, -1.2),
        (0.4, -1.2),
        (0.4, -0.4),
        (1.2, -0.4),
        (1.2, 0.4),
        (0.4, 0.4),
        (0.4, 1.2),
        (-0.4, 1.2),
        (-0.4, 0.4),
        (-1.2, 0.4),
        (-1.2, -0.4),
        (-0.4, -0.4),
    ],
    &[
        (-1.2, -0.6),
        (-0.6, -1.2),
        (0.0, -0.6),
        (0.6, -1.2),
        (1.2, -0.6),
        (0.6, 0.0),
        (1.2, 0.6),
        (0.6, 1.2),
        (0.0, 0.6),
        (-0.6, 1.2),
        (-1.2, 0.6),
        (-0.6, 0.0),
    ],
];
