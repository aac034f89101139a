//! Dropout layer: finds what the missing measurements depend on.
//!
//! Losses are judged in log odds, view by view. Views differ for no reason, typically by a factor of e, so a
//! finding must hold across views. Steps in range or tilt have a name unless a nameless curve does clearly
//! better.

pub mod cells;
mod clumps;
pub mod few;
pub mod fit;
pub mod forms;
pub mod hard_end;
mod odds;
pub mod points;
pub mod report;
mod round;
mod runs;
pub mod search;
pub mod shapes;

use crate::camera::{Camera, Rays};
use crate::diagnose::diagnosis::{Detectable, Finding};
use crate::diagnose::edges::shadow::{Sides, band, bands_agree};
use crate::diagnose::views::field::Field;
use crate::diagnose::views::layers::Survey;
use crate::diagnose::views::margins::Margins;
use crate::diagnose::views::tiles::rim_px;
use crate::rng::Seed;
use crate::terms::Extent;
use cells::{Cell, MIN_SCATTER, USUAL, cells, fine, patches, set_expected};
use clumps::frames_together;
use few::few_losses;
use hard_end::{CloseLook, HardEnd, blur};
use points::points_of_pixels;
use report::{DropoutReporter, detectable, rivals, shadow_finding};
use round::Round;
use search::{Judged, times};
use shapes::{Shapes, Step};

/// Outcome of the dropout search.
#[derive(Debug, Clone, Default)]
pub struct DropoutOutcome {
    /// Largest gain first.
    pub findings: Vec<Finding>,
    /// Per family, the middle of the faintest whole step that 80 % of such recordings would show, in degrees
    /// or m. A step that begins farther out goes unseen.
    pub detectable: Vec<Detectable>,
    /// Hard ends of the range; they are not findings.
    pub ends: Vec<Step>,
    /// Remarks that are not findings.
    pub notes: Vec<String>,
}

impl DropoutOutcome {
    fn take_end(&mut self, end: &HardEnd) {
        self.notes.insert(0, end.note());
        self.ends.push(end.step());
    }
}

/// Fewest views that can show a rule.
const MIN_VIEWS: usize = 4;
/// False-alarm probability of steps and curves on a clean recording, and of the shadow.
pub const LEVEL: f64 = 0.003;
/// Tests that share [`LEVEL`]: constant steps and curves, steps that begin mid-session, and the foot of a
/// rise.
const TESTS: f64 = 3.0;
const MAX_FINDINGS: usize = 3;
/// Least gain of a later finding, as a share of the first finding's.
const MIN_OF_FIRST: f64 = 0.1;

/// Finds what the losses of a recording depend on.
///
/// `twins` are the same views without the effects looked for; what they lose is expected.
pub fn missing(
    fields: &[Field],
    twins: Option<(&[Field], &Survey)>,
    survey: &Survey,
    (camera, rays): (&Camera, &Rays),
    seed: Seed,
) -> DropoutOutcome {
    let region_given: Vec<bool> = fields.iter().map(|f| f.region_given).collect();
    let second = survey.second();
    let margins = Margins::of(fields);
    let (large, fine) = (patches(survey, camera, &margins), fine(survey, &margins));
    let mut mine = cells(&large, &frames_together(fields));
    if let Some((fields, survey)) = twins {
        let twins = patches(survey, camera, &margins);
        set_expected(&mut mine, &cells(&twins, &frames_together(fields)), rim_px(camera));
    }
    let beside_twins = twins.is_some();
    let seen = DropoutCells { cells: mine, fine, region_given, second, beside_twins };
    let look = CloseLook {
        blur: &|z| blur(survey, z),
        points: &|span| points_of_pixels(fields, rays, &margins, span),
        reach: survey.reach.z,
    };
    let mut outcome = DropoutSearch { reach: &survey.reach, camera, look, seed }.losses(&seen);
    outcome.notes.extend(margins.notes());
    let sides: Vec<Sides> = (0..fields.len())
        .map(|v| Sides::of(&fields[v].edges, twins.map(|(t, _)| &t[v].edges)))
        .collect();
    if let Some(band) = band(&sides, LEVEL) {
        let mut shadow = shadow_finding(band, fields);
        let of_all = shadow.of_some.is_none();
        shadow.replicated = of_all.then(|| bands_agree(&sides, &seen.second)).flatten();
        // Where the target's own mask reaches into its shadow, the search finds the same losses again. A
        // region that was given ends at the target.
        let grown = seen.region_given.contains(&false);
        let larger = |f: &Finding| f.size.sigma > shadow.size.sigma;
        outcome.findings.retain(|f| !grown || !of_all || f.effect.is_some() || larger(f));
        outcome.findings.push(shadow);
    }
    outcome
}

/// Losses of the views on the target.
#[derive(Clone)]
struct DropoutCells<'a> {
    /// Patches large enough to judge.
    cells: Vec<Vec<Cell<'a>>>,
    /// Smallest patches.
    fine: Vec<Vec<Cell<'a>>>,
    /// Whether a view's region was given.
    region_given: Vec<bool>,
    /// Whether each view is in the second half.
    second: Vec<bool>,
    beside_twins: bool,
}

impl DropoutCells<'_> {
    /// Copy without the patches that a hard end of the range touches.
    fn inside(&self, end: &HardEnd) -> Self {
        let mut rest = self.clone();
        let views = rest.cells.iter_mut().chain(&mut rest.fine);
        views.for_each(|v| v.retain(|c| !end.touches(c)));
        rest
    }
}

/// Inputs of the dropout search.
struct DropoutSearch<'a> {
    reach: &'a Extent,
    camera: &'a Camera,
    look: CloseLook<'a>,
    seed: Seed,
}

impl DropoutSearch<'_> {
    fn losses(&self, seen: &DropoutCells<'_>) -> DropoutOutcome {
        let views = &seen.cells;
        let mut outcome = DropoutOutcome::default();
        let count = views.iter().filter(|v| !v.is_empty()).count();
        if count < MIN_VIEWS {
            outcome.notes.push(format!(
                "what is lost could not be tested: {MIN_VIEWS} views of a target are needed, and {count} can be used"
            ));
            return outcome;
        }
        let shapes = Shapes::of(self.reach, self.camera, times(views));
        let mut open = shapes.clone();
        let mut explained: Vec<Vec<f64>> =
            views.iter().map(|v| v.iter().map(|c| c.expected).collect()).collect();
        while outcome.findings.len() < MAX_FINDINGS {
            let of = |steps: &[Step], min_scatter| {
                Round::of(views, &explained, (steps, &open.curves), min_scatter, self.seed)
            };
            let Some(always) = of(&open.steps, MIN_SCATTER) else { break };
            if outcome.findings.is_empty() {
                outcome.detectable = detectable(&always.ledger, &shapes.steps, always.threshold());
            }
            if outcome.findings.is_empty() && outcome.ends.is_empty() {
                outcome.notes.extend(lost_everywhere(always.ledger.base));
            }
            // Steps that begin mid-session are tried only where no constant one is found. Few views show the
            // scatter after the start, so it is not trusted below the usual.
            let mut won = self.won(&always, seen);
            let mut round = always;
            if outcome.findings.is_empty() && won.is_none() {
                let Some(begun) = of(&open.begun, USUAL) else { break };
                (won, round) = (self.won(&begun, seen), begun);
            }
            let Some((won, counts)) = won else { break };
            let (won, Round { ledger, judged, noise }) = (&round.judged[won], &round);
            if outcome.findings.first().is_some_and(|f| won.gain < MIN_OF_FIRST * f.share) {
                break;
            }
            let p = noise.p(counts);
            let told = |won: &Judged| {
                let rivals = rivals(std::iter::once(won).chain(judged));
                let reporter = DropoutReporter { search: self, seen, base: ledger.base };
                let finding = reporter.finding(won, &rivals, TESTS * p);
                Finding { replicated: ledger.replicate(won, &seen.second), ..finding }
            };
            // Losses that a step predicts but do not rise as one belong to the curve that predicts them better.
            let (step, curve) = (told(won), judged.iter().find(|j| j.shape.family().is_none()));
            let better = curve.filter(|c| step.effect.is_none() && c.gain > won.gain);
            let (won, finding) = better.map_or((won, step), |curve| (curve, told(curve)));
            let end = self.end(&finding, ledger.base);
            if let Some(end) = end.as_ref().filter(|e| touches(views, e)) {
                return self.within(end, seen);
            }
            let later = if end.is_none() { ledger.later(won) } else { None };
            let more = ledger.explained(later.as_ref().unwrap_or(won));
            explained.iter_mut().flatten().zip(more.iter().flatten()).for_each(|(e, m)| *e += m);
            open.drop_axis(won.shape.axis());
            match end {
                Some(end) => outcome.take_end(&end),
                None => outcome.findings.push(later.as_ref().map_or(finding, told)),
            }
        }
        // Total counts are not compared with a twin's.
        if outcome.findings.is_empty() && !seen.beside_twins {
            return self.few(seen, outcome);
        }
        outcome
    }

    /// Index of the shape detected in a round, and the nats that count for it. Beside a twin, the shape must
    /// still be detected when any single view is left out. A hard end of the range is exempt: the farthest
    /// view may cross it alone.
    fn won(&self, round: &Round<'_>, seen: &DropoutCells<'_>) -> Option<(usize, f64)> {
        if !seen.beside_twins {
            return round.won();
        }
        let Round { ledger, judged, .. } = round;
        let (first, gain) = round.won()?;
        let won = &judged[first];
        let reporter = DropoutReporter { search: self, seen, base: ledger.base };
        let finding = reporter.finding(won, &rivals([won]), 0.0);
        let ends = self.end(&finding, ledger.base).is_some();
        if ends { Some((first, gain)) } else { round.won_beyond_one_view() }
    }

    /// Losses too few to form a share of a patch, where nothing else is found.
    fn few(&self, seen: &DropoutCells<'_>, mut outcome: DropoutOutcome) -> DropoutOutcome {
        let (rim, level) = (rim_px(self.camera), LEVEL / TESTS);
        let Some((foot, p)) = few_losses(&seen.fine, rim, self.reach, level, self.seed) else {
            return outcome;
        };
        let reporter = DropoutReporter { search: self, seen, base: 0.0 };
        let finding = reporter.finding(&foot, &rivals([&foot]), TESTS * p);
        // A view whose corner is cut off by a hard end looks like the foot of a rise.
        match self.end(&finding, 0.0) {
            Some(end) if touches(&seen.fine, &end) => return self.within(&end, seen),
            Some(end) => outcome.take_end(&end),
            None => outcome.findings.push(finding),
        }
        outcome
    }

    /// Repeats the search on the losses inside a hard end; those beyond it carry no information.
    fn within(&self, end: &HardEnd, seen: &DropoutCells<'_>) -> DropoutOutcome {
        let spared =
            |span| (self.look.points)(span).into_iter().filter(|p| end.spares(p.x)).collect();
        let reach = end.spared(self.look.reach);
        let look = CloseLook { points: &spared, reach, ..self.look };
        let mut rest = DropoutSearch { look, ..*self }.losses(&seen.inside(end));
        rest.take_end(end);
        rest
    }

    /// The hard end of the range, if the finding is one.
    fn end(&self, found: &Finding, base: f64) -> Option<HardEnd> {
        let step = Step::of(found.effect?, |name| found.value(name))?;
        let error = found.parameters.get("width_m").and_then(|w| w.get("std_error")?.as_f64());
        HardEnd::of(&step, error.unwrap_or(f64::INFINITY), base, &self.look)
    }
}

/// Note on readings lost wherever the target is; the model predicts no such share.
fn lost_everywhere(share: f64) -> Option<String> {
    const WORTH_A_WORD: f64 = 0.005;
    (share > WORTH_A_WORD).then(|| {
        format!(
            "{:.1} % of the readings are missing wherever the target is: a model has no share for that, and it is no finding",
            100.0 * share
        )
    })
}

fn touches(views: &[Vec<Cell<'_>>], end: &HardEnd) -> bool {
    views.iter().flatten().any(|c| end.touches(c))
}

#[cfg(test)]
mod single_losses_tests;
#[cfg(test)]
mod tests;
