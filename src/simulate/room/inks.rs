//! Colours, and places on a picture, as chance will have them.

use rand::Rng;

use super::canvas::{Area, Colour};
use crate::rng::Stream;

pub const BLACK: Colour = [22, 22, 26];
pub const WHITE: Colour = [246, 246, 242];

pub fn any(rng: &mut Stream) -> Colour {
    let strong = [
        [178, 34, 40],
        [24, 78, 142],
        [30, 116, 66],
        [232, 186, 40],
        [222, 106, 34],
        [88, 44, 120],
        [20, 132, 142],
        [122, 72, 40],
        [60, 62, 70],
        [236, 230, 214],
    ];
    strong[rng.random_range(0..strong.len())]
}

/// The ink that is read best on this ground.
pub fn ink_on(ground: Colour) -> Colour {
    let grey: u16 = ground.iter().map(|c| u16::from(*c)).sum::<u16>() / 3;
    if grey > 125 { BLACK } else { WHITE }
}

pub fn area(rng: &mut Stream, least: f32, most: f32) -> Area {
    let (w, h) = (rng.random_range(least..most), rng.random_range(least..most));
    let (x, y) = (rng.random_range(0.0..1.0 - w), rng.random_range(0.0..1.0 - h));
    [x, y, x + w, y + h]
}
