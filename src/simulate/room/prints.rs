//! The office's textures, drawn by the seed: what is printed, woven, grown or shown on a screen.
//!
//! Each has sharp structure at several scales, so that corners are found from near and from afar.

use super::canvas::Canvas;
use super::grounds::{ball, carpet, ceiling, clock, cloth, plain, plaster, window, wood};
use super::papers::{board, carton, keys, label, page, poster, screen, spines};
use super::texture::Texture;
use crate::rng::{Seed, Stream};

/// Indices into the room's textures, by what they show.
#[derive(Debug, Clone, PartialEq)]
pub struct Prints {
    pub plain: usize,
    pub plaster: usize,
    pub ceiling: usize,
    pub carpet: usize,
    pub wood: usize,
    pub cloth: usize,
    pub keys: usize,
    pub window: usize,
    pub clock: usize,
    pub ball: usize,
    pub board: usize,
    pub pages: Vec<usize>,
    pub posters: Vec<usize>,
    pub spines: Vec<usize>,
    pub screens: Vec<usize>,
    pub cartons: Vec<usize>,
    pub labels: Vec<usize>,
}

/// Draws one kind of texture.
type Draw = fn(&mut Stream) -> Canvas;

/// Collects textures; each is drawn from a stream of its own.
struct Press {
    seed: Seed,
    textures: Vec<Texture>,
}

impl Press {
    fn one(&mut self, name: &str, draw: Draw) -> usize {
        let mut rng = self.seed.stream(&format!("room/print/{name}"));
        self.textures.push(draw(&mut rng).finish());
        self.textures.len() - 1
    }

    fn several(&mut self, name: &str, count: usize, draw: Draw) -> Vec<usize> {
        (0..count).map(|k| self.one(&format!("{name}/{k}"), draw)).collect()
    }
}

impl Prints {
    /// All of them, with the textures they number.
    pub fn new(seed: Seed) -> (Prints, Vec<Texture>) {
        let mut press = Press { seed, textures: Vec::new() };
        let prints = Prints {
            plain: press.one("plain", plain),
            plaster: press.one("plaster", plaster),
            ceiling: press.one("ceiling", ceiling),
            carpet: press.one("carpet", carpet),
            wood: press.one("wood", wood),
            cloth: press.one("cloth", cloth),
            keys: press.one("keys", keys),
            window: press.one("window", window),
            clock: press.one("clock", clock),
            ball: press.one("ball", ball),
            board: press.one("board", board),
            pages: press.several("page", 6, page),
            posters: press.several("poster", 6, poster),
            spines: press.several("spines", 6, spines),
            screens: press.several("screen", 3, screen),
            cartons: press.several("carton", 3, carton),
            labels: press.several("label", 3, label),
        };
        (prints, press.textures)
    }
}
