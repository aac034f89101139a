//! Recordings that a real sensor took, with something struck from their model, with something added
//! to them, or with nothing done to them at all.
//!
//! What is hidden here cannot be known but by the tool itself: the *full model* of a recording is
//! what calibration and diagnosis find in it, asked again until they find no more. This is the one
//! world that takes its truth from what is on trial. It asks less than the others therefore: a term
//! that was struck must be found and named again from other views than all (amnesia); an effect of
//! the first world, which shares no formula with the tool, must stand out from residuals that no
//! simulator made (transplant); and one half of a recording must not contradict what was learnt of
//! the other (halves).
//!
//! Nothing real is in this repository: the words come from the user's own folder of data and go to
//! the user's own output folder.

mod amnesia;
mod change;
mod dither;
mod full;
mod gain;
mod scene;
mod sources;
#[cfg(test)]
mod tests;
mod transplant;
#[cfg(test)]
mod word_tests;
mod write;

pub use sources::{Source, recordings};

use std::path::Path;
use std::sync::Arc;

use rand::Rng;
use rand::seq::SliceRandom;
use serde_json::{Value, json};

use super::{Asked, Cell, Hidden, Sealed, Truth};
use change::Graft;
use full::{Full, full, learnt};
use kinoise::error::{Error, Result};
use kinoise::model::NoiseModel;
use kinoise::rng::{Seed, Stream};

/// Of the views that a recording has, a set takes at least and at most this share.
const KEPT: [f64; 2] = [0.6, 0.92];
/// A diagnosis of fewer says too little.
const MIN_VIEWS: usize = 6;

/// A set of real views.
struct Real {
    full: Arc<Full>,
    /// Numbers of the views, ascending.
    views: Vec<usize>,
    model: NoiseModel,
    graft: Option<Graft>,
    truth: Truth,
}

/// Make the set that is asked for of a recording in `data`, by lot where there are several.
///
/// # Errors
/// When there is none in `data`, or it cannot show what is asked for.
pub fn seal(asked: &Asked, data: &Path) -> Result<Box<dyn Sealed>> {
    if !matches!(asked.cell, Cell::Amnesia | Cell::Transplant | Cell::Halves) {
        return Err(Error::Argument {
            what: format!("{}: real recordings have no such sets", json!(asked.cell)),
            remedy: "ask for amnesia, transplant or halves",
        });
    }
    let sources = sources::required(data)?;
    let seed = Seed(asked.seed);
    let mut rng = seed.stream("real/set");
    let set = one_of(sources, &mut rng, &|full, rng| taken(full, asked, seed, rng))?;
    Ok(Box::new(set))
}

/// The set of this recording.
fn taken(full: Arc<Full>, asked: &Asked, seed: Seed, rng: &mut Stream) -> Result<Real> {
    let all = full.recording.views.len();
    Ok(match asked.cell {
        Cell::Amnesia => {
            let views = some(all, rng);
            let share = full.measured(&views) / full.measured(&(0..all).collect::<Vec<_>>());
            let (model, hidden) = amnesia::strike(&full, asked, share, rng)?;
            Real::new(full, views, model, None, asked, vec![hidden])
        }
        Cell::Transplant => {
            let views = some(all, rng);
            let (graft, hidden) = transplant::graft(&full, asked, &views, seed, rng)?;
            let model = full.model.clone();
            Real::new(full, views, model, Some(graft), asked, hidden)
        }
        _ => {
            let [mine, theirs] = halves(all, rng);
            let mut other = full.recording.clone();
            other.views = theirs.iter().map(|&k| full.recording.views[k].clone()).collect();
            let model = learnt(&other)?;
            Real::new(full, mine, model, None, asked, Vec::new())
        }
    })
}

type Taking<'a> = &'a dyn Fn(Arc<Full>, &mut Stream) -> Result<Real>;

/// By lot, of those that can be used and can show what is asked for.
fn one_of(mut sources: Vec<Source>, rng: &mut Stream, take: Taking<'_>) -> Result<Real> {
    sources.shuffle(rng);
    let mut whys = Vec::new();
    for source in &sources {
        let taken =
            full(source).and_then(|full| take(full, &mut rng.clone()).map_err(|e| e.to_string()));
        match taken {
            Ok(set) => return Ok(set),
            Err(why) => whys.push(why),
        }
    }
    Err(Error::Argument {
        what: whys.join("; "),
        remedy: "give a folder with another recording, or leave the real sets out",
    })
}

/// Views by lot, ascending.
fn some(all: usize, rng: &mut Stream) -> Vec<usize> {
    let [least, most] = KEPT.map(|share| (share * all as f64).round() as usize);
    let least = least.max(MIN_VIEWS).min(all);
    let count = rng.random_range(least..=most.max(least));
    dealt(all, rng, count)[0].clone()
}

/// All views, dealt to two.
fn halves(all: usize, rng: &mut Stream) -> [Vec<usize>; 2] {
    dealt(all, rng, all / 2)
}

fn dealt(all: usize, rng: &mut Stream, count: usize) -> [Vec<usize>; 2] {
    let mut numbers: Vec<usize> = (0..all).collect();
    numbers.shuffle(rng);
    let mut rest = numbers.split_off(count);
    numbers.sort_unstable();
    rest.sort_unstable();
    [numbers, rest]
}

impl Real {
    fn new(
        full: Arc<Full>,
        views: Vec<usize>,
        model: NoiseModel,
        graft: Option<Graft>,
        asked: &Asked,
        hidden: Vec<Hidden>,
    ) -> Self {
        let base = base(&full, &views, &model);
        Real { full, views, model, graft, truth: Truth { asked: asked.clone(), hidden, base } }
    }
}

fn base(full: &Full, views: &[usize], model: &NoiseModel) -> Value {
    let names: Vec<&str> = views.iter().map(|&k| full.recording.views[k].name.as_str()).collect();
    let known: Vec<&str> = model.effects.iter().map(|e| e.id.as_str()).collect();
    let root = &full.recording.root;
    // data/UNIT/recording is called UNIT.
    let named = if root.ends_with("recording") { root.parent().unwrap_or(root) } else { root };
    json!({
        "recording": named.file_name().unwrap_or_default().to_string_lossy(),
        "sensor": full.recording.sensor.name,
        "views": names,
        "known": known,
    })
}

impl Sealed for Real {
    fn truth(&self) -> Truth {
        self.truth.clone()
    }

    fn write(&self, folder: &Path) -> Result<()> {
        write::write(self, folder)
    }
}
