//! Recordings of a real sensor, with a term struck from their model or with nothing done to them at all.
//!
//! Only the tool itself can know what is hidden here: the *full model* of a recording is what calibration
//! and diagnosis find in it, repeated until they find no more. This is the only world that takes its truth
//! from what is on trial, so it asks less than the others: a term that was struck must be found and named
//! again from a part of the views (amnesia), and one half of a recording must not contradict what was learnt
//! of the other (halves).
//!
//! Nothing real is in this repository: the images come from the user's own data folder and go to the user's
//! own output folder.

mod full;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rand::Rng;
use rand::seq::{IndexedRandom, SliceRandom};
use serde_json::json;

use crate::raytraced::question::{Asked, Cell, ConcealedSet, Hidden, Truth};
use crate::raytraced::write::images;
pub use full::Full;
use full::explain;
use kinoise::error::{Error, Result};
use kinoise::io::{DESCRIPTION, write_recording_file, write_view_notes};
use kinoise::model::NoiseModel;
use kinoise::rng::{Seed, Stream};
use kinoise::view::{View, ViewNotes};

/// Smallest and largest share of a recording's views in a set.
const KEPT: [f64; 2] = [0.6, 0.92];
/// Minimum number of views; a diagnosis of fewer says too little.
const MIN_VIEWS: usize = 6;
/// Minimum gain of a term that is struck, nats; a weaker one is not what the recording needs.
const MIN_NATS: f64 = 50.0;
/// Terms without a name are known by their place only: one set in this many may strike one.
const NAMELESS_EVERY: u32 = 5;

/// A set of real views.
struct Real {
    full: Arc<Full>,
    /// Indices of the views, ascending.
    views: Vec<usize>,
    model: NoiseModel,
    truth: Truth,
}

/// Learns each recording in `data`; leaves out those that remain unexplained.
pub fn learn(data: &Path) -> Result<Vec<Arc<Full>>> {
    let (mut known, mut whys) = (Vec::new(), Vec::new());
    for path in recordings(data) {
        match Full::learn(&path) {
            Ok(full) => known.push(Arc::new(full)),
            Err(why) => whys.push(why.to_string()),
        }
    }
    if known.is_empty() {
        whys.insert(0, format!("{}: no real recording of a plane is here", data.display()));
        return Err(of_no_use(&whys));
    }
    Ok(known)
}

fn of_no_use(whys: &[String]) -> Error {
    Error::Argument {
        what: whys.join("; "),
        remedy: "give --data a folder with another recording (recording.json and a folder a view), or \
                 leave the real sets out",
    }
}

/// The recordings in `data`, in name order: `data` itself, its folders, and `recording/` in these,
/// wherever a `recording.json` describes them.
fn recordings(data: &Path) -> Vec<PathBuf> {
    let described = |path: &PathBuf| path.join(DESCRIPTION).is_file();
    let data = data.to_path_buf();
    if described(&data) {
        return vec![data];
    }
    let entries = fs::read_dir(data).into_iter().flatten();
    let mut folders: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    folders.sort();
    let of =
        |folder: PathBuf| [folder.clone(), folder.join("recording")].into_iter().find(described);
    folders.into_iter().filter_map(of).collect()
}

/// Makes the set that is asked for from a known recording, chosen at random.
pub fn conceal(asked: &Asked, known: &[Arc<Full>]) -> Result<Box<dyn ConcealedSet>> {
    let mut rng = Seed(asked.seed).stream("real/set");
    let mut known = known.to_vec();
    known.shuffle(&mut rng);
    let mut whys = vec![format!("{} of a real recording cannot be had", json!(asked.cell))];
    for full in known {
        match taken(full, asked, &mut rng.clone()) {
            Ok(set) => return Ok(Box::new(set)),
            Err(why) => whys.push(why.to_string()),
        }
    }
    Err(of_no_use(&whys))
}

/// Makes the set from this recording.
fn taken(full: Arc<Full>, asked: &Asked, rng: &mut Stream) -> Result<Real> {
    let all = full.recording.views.len();
    let (mut model, mut hidden) = (full.model.clone(), Vec::new());
    let views = if asked.cell == Cell::Halves {
        let [mine, theirs] = dealt(all, all / 2, rng);
        let mut other = full.recording.clone();
        other.views = theirs.iter().map(|&k| full.recording.views[k].clone()).collect();
        model = explain(&other)?.model;
        mine
    } else {
        let [min, max] = KEPT.map(|share| (share * all as f64).round() as usize);
        let min = min.max(MIN_VIEWS).min(all);
        let count = rng.random_range(min..=max.max(min));
        let [views, _] = dealt(all, count, rng);
        let (k, term) = struck(&full, asked, &views, rng)?;
        model.effects.remove(k);
        hidden.push(term);
        views
    };
    let root = &full.recording.root;
    // data/UNIT/recording is called UNIT.
    let named = if root.ends_with("recording") { root.parent().unwrap_or(root) } else { root };
    let base = json!({
        "recording": named.file_name().unwrap_or_default().to_string_lossy(),
        "sensor": full.recording.sensor.name,
        "views": views.iter().map(|&k| &full.recording.views[k].name).collect::<Vec<_>>(),
        "known": model.effects.iter().map(|e| &e.id).collect::<Vec<_>>(),
    });
    let truth = Truth { asked: asked.clone(), hidden, base };
    Ok(Real { full, views, model, truth })
}

/// `count` of all view indices at random, and the others, both ascending.
fn dealt(all: usize, count: usize, rng: &mut Stream) -> [Vec<usize>; 2] {
    let mut numbers: Vec<usize> = (0..all).collect();
    numbers.shuffle(rng);
    let mut rest = numbers.split_off(count);
    numbers.sort_unstable();
    rest.sort_unstable();
    [numbers, rest]
}

/// Index of the full model's term that is struck, and that term with its worth in these views.
fn struck(
    full: &Full,
    asked: &Asked,
    views: &[usize],
    rng: &mut Stream,
) -> Result<(usize, Hidden)> {
    let share = full.share(views);
    let min = asked.nats.unwrap_or(MIN_NATS);
    let by_name = !asked.names.is_empty();
    let fits = |term: &Hidden| match by_name {
        true => asked.names.contains(&term.form),
        false => term.nats.is_none_or(|nats| nats * share >= min),
    };
    let mut choice: Vec<usize> = (0..full.terms.len()).filter(|&k| fits(&full.terms[k])).collect();
    let named = |k: &usize| !full.terms[*k].names.is_empty();
    if !by_name && rng.random_range(0..NAMELESS_EVERY) > 0 && choice.iter().any(named) {
        choice.retain(named);
    }
    let Some(&k) = choice.choose(rng) else {
        let has: Vec<&str> = full.terms.iter().map(|t| t.form.as_str()).collect();
        return Err(Error::recording(
            &full.recording.root,
            format!("no term to strike; its model holds {}", has.join(", ")),
            "name one of these, or ask for fewer nats",
        ));
    };
    let term = full.terms[k].clone();
    Ok((k, Hidden { nats: term.nats.map(|nats| nats * share), ..term }))
}

impl ConcealedSet for Real {
    fn truth(&self) -> Truth {
        self.truth.clone()
    }

    fn write(&self, folder: &Path) -> Result<()> {
        let root = folder.join("recording");
        fs::create_dir_all(&root).map_err(|e| Error::write(&root, e))?;
        write_recording_file(&root, &self.full.recording.sensor)?;
        for (n, &k) in self.views.iter().enumerate() {
            copy(&self.full.recording.views[k], &root.join(format!("{n:04}")))?;
        }
        self.model.write(&folder.join("model.json"))
    }
}

/// Copies the view's images as they are. A person's notes are left out: they might reveal something.
fn copy(view: &View, folder: &Path) -> Result<()> {
    for (kind, files) in [("depth", &view.depth), ("ir", &view.infrared)] {
        let Some(first) = files.first() else { continue };
        let ending = first.path.extension().and_then(|e| e.to_str()).unwrap_or("png");
        let bytes = |path: &Path| fs::read(path).map_err(|e| Error::read(path, e));
        images(folder, kind, ending, files.iter().map(|f| (f.timestamp, bytes(&f.path))))?;
    }
    write_view_notes(folder, &ViewNotes { notes: None, ..view.notes.clone() })
}
