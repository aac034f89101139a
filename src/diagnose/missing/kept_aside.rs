//! What the losses' shapes are worth on views that had no part in choosing them.

use super::cells::{LEAST, USUAL, patches};
use super::dropout_cells::DropoutCells;
use super::shapes::Shapes;
use super::{DropoutOutcome, FEWEST_VIEWS, Round, times};
use crate::camera::Camera;
use crate::diagnose::diagnosis::Finding;
use crate::diagnose::views::field::Field;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::margins::Margins;
use crate::rng::Seed;
use crate::terms::{Axis, Extent};

/// The search once more on the `rest` of the views, in as many rounds as all views together brought findings of
/// patches, and what its shapes bring to each of the views kept `aside`: nats. What the model has is no news.
pub fn gained(
    found: &DropoutOutcome,
    (fields, twins, survey): (&[Field], Option<&Survey>, &Survey),
    camera: &Camera,
    known: &KnownTerms,
    [rest, aside]: [&[usize]; 2],
    seed: Seed,
) -> Vec<f64> {
    let mut gains = vec![0.0; aside.len()];
    let of_patches = |f: &&Finding| f.effect != Some("occlusion-shadow");
    let rounds = found.findings.iter().filter(of_patches).count();
    if rounds == 0 || rest.len() < FEWEST_VIEWS {
        return gains;
    }
    let margins = Margins::of(fields);
    let large = patches(survey, camera, &margins);
    let all = DropoutCells::of(&large, fields, twins, (survey, camera, &margins));
    let all = found.ends.iter().fold(all, |seen, end| seen.inside(end));
    let known_of_all = all.explained();
    let [views, others] = [rest, aside].map(|which| pick(&all.cells, which));
    let [mut explained, mut theirs] = [rest, aside].map(|which| pick(&known_of_all, which));
    let reach = Extent::of(views.iter().flatten().map(|c| c.place));
    let shapes = Shapes::of(&reach, camera, times(&views));
    let mut taken: Vec<Axis> = Vec::new();
    for n in 0..rounds {
        let open = shapes.beside(&taken);
        let of = |steps, least| Round::of(&views, &explained, (steps, &open.curves), least, seed);
        let round = of(&open.steps, LEAST)
            .and_then(|always| always.or_begun(n == 0, || of(&open.begun, USUAL)));
        let Some(round) = &round else { break };
        let Some(won) = round.won() else { break };
        let ledger = &round.ledger;
        let later = ledger.later(won);
        let won = later.as_ref().unwrap_or(won);
        if !won.shape.family().is_some_and(|id| known.has(id)) {
            let brought = ledger.brings(won, &others, &theirs);
            gains.iter_mut().zip(brought).for_each(|(sum, nats)| *sum += nats);
        }
        taken.push(won.shape.axis());
        let more = [ledger.explained(won), ledger.explained_of(won, &others)];
        add(&mut explained, &more[0]);
        add(&mut theirs, &more[1]);
    }
    gains
}

fn pick<T: Clone>(of: &[T], which: &[usize]) -> Vec<T> {
    which.iter().map(|&v| of[v].clone()).collect()
}

fn add(to: &mut [Vec<f64>], more: &[Vec<f64>]) {
    to.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(sum, m)| *sum += m);
}
