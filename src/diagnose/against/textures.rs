//! Comparison with a simulated recording: the structure of the noise and steps, view by view.

use super::Baseline;
use crate::diagnose::noise::in_time::still_level;
use crate::diagnose::noise::lagged::of_any_two_frames;
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::texture_finding::TextureFinding;
use crate::diagnose::noise::texture_findings;
use crate::diagnose::steps::KINDS;
use crate::diagnose::steps::lattice::Step;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::layers::Survey;
use crate::stats::{mean, range};

/// Factor within which the tails of two recordings are alike: gross errors clump.
const TAILS_ALIKE: f64 = 3.0;

impl Baseline {
    /// Replaces each statistic of the real views by its difference from the twin's plus the mean over the
    /// simulated recording, which goes to `known`.
    pub fn compare(&self, structure: &mut [Structure], real: Option<Step>, known: &mut KnownTerms) {
        let windows = self.level(|s| s.window_px.map(f64::ln));
        let fixed = self.level(|s| s.still.fixed_px2).max(0.0);
        let (rows, columns) = (self.level(|s| s.row_px2), self.level(|s| s.column_px2));
        let stands = still_level(&self.structure).is_some_and(|share| share > 0.0);
        let lags = self.lags(stands);
        for (s, twin) in structure.iter_mut().zip(&self.structure) {
            let differ = |real: &mut Option<f64>, twin: Option<f64>, level: f64| {
                *real = real.zip(twin).map(|(r, t)| r - t + level);
            };
            s.window_px = s.window_px.zip(twin.window_px).map(|(r, t)| r / t * windows.exp());
            // A window for part of the noise shows here alone.
            differ(&mut s.neighbour_correlation, twin.neighbour_correlation, 0.0);
            differ(&mut s.near_sum, twin.near_sum, 1.0);
            let profiles = s.correlation_profile.zip(twin.correlation_profile);
            s.correlation_profile = profiles.map(|(r, t)| std::array::from_fn(|k| r[k] - t[k]));
            differ(&mut s.still.fixed_px2, twin.still.fixed_px2, fixed);
            differ(&mut s.row_px2, twin.row_px2, rows.max(0.0));
            // Nothing is known of columns: what both have must cancel.
            differ(&mut s.column_px2, twin.column_px2, columns.min(0.0));
            differ(&mut s.still.blotches_px2, twin.still.blotches_px2, 0.0);
            let lines = s.still.lines_px2.iter_mut().zip(twin.still.lines_px2);
            let frames = s.frame_log_variance.iter_mut().zip(twin.frame_log_variance);
            lines.chain(frames).for_each(|(real, twin)| differ(real, twin, 0.0));
            for (k, lag) in lags.iter().enumerate() {
                // Of frames that the twin has; where rounding hides its correlation, nothing is known.
                if twin.stored[k].is_some() {
                    differ(&mut s.lagged[k], twin.lagged[k], *lag);
                }
            }
        }
        known.learn("spatial-correlation", "length_px", windows.exp());
        known.learn("fixed-pattern-noise", "sigma_px", fixed.sqrt());
        known.learn("row-noise", "sigma_px", rows.max(0.0).sqrt());
        if stands {
            known.learn("frozen-noise", "fraction", self.still_at(lags, fixed));
        }
        let once = ["frozen-noise", "temporal-correlation", "frame-jitter", "target-motion"];
        let once = &once[usize::from(stands)..];
        for texture in &self.textures {
            for id in once.iter().filter(|id| texture.families.contains(id)) {
                for (name, value) in &texture.parameters {
                    known.learn(id, name, value["value"].as_f64().unwrap_or(0.0));
                }
            }
        }
        if self.heavy {
            known.learn("heavy-tails", "fraction", 0.0);
        }
        let alike = |a: Option<Step>, b: Option<Step>| {
            a.zip(b).is_some_and(|(a, b)| (a.size / b.size).ln().abs() < STEPS_ALIKE)
        };
        for kind in KINDS {
            if alike(kind.of(self.lattice), kind.of(real)) {
                known.learn(kind.id, kind.parameter, 0.0);
            }
        }
    }

    /// Mean over the simulated views; 0 without any.
    fn level(&self, of: impl Fn(&Structure) -> Option<f64>) -> f64 {
        mean(self.structure.iter().filter_map(of)).unwrap_or(0.0)
    }

    /// Correlation at each lag that the differences from the twins' are added to. What the twins' lose over the
    /// lags by chance is no fall of the real ones: where their noise `stands` and does not fade, all lags get
    /// the mean over pairs of frames.
    fn lags(&self, stands: bool) -> [f64; 3] {
        let lags = std::array::from_fn(|k| self.level(|s| s.lagged[k]));
        let fades = self.textures.iter().any(|t| t.families.contains(&"temporal-correlation"));
        if !stands || fades {
            return lags;
        }
        let frames = self.fields.iter().map(|f| f.frames.len()).max().unwrap_or(0);
        [of_any_two_frames(lags, frames); 3]
    }

    /// Share that stands still in twins of these correlations and this pattern. Their own correlations may be
    /// skewed, and a robust mean of them is then another.
    fn still_at(&self, lags: [f64; 3], fixed_px2: f64) -> f64 {
        let at_level = |twin: &Structure| {
            let mut twin = twin.clone();
            twin.still.fixed_px2 = twin.still.fixed_px2.map(|_| fixed_px2);
            twin.lagged = std::array::from_fn(|k| twin.lagged[k].map(|_| lags[k]));
            twin
        };
        let twins: Vec<Structure> = self.structure.iter().map(at_level).collect();
        still_level(&twins).unwrap_or(0.0)
    }

    /// Whether the recording's tails are not much heavier than the simulation's.
    pub fn tails_alike(&self, real: &[Structure]) -> bool {
        let tail = |all: &[Structure]| {
            mean(all.iter().filter(|s| s.tails.n > 0.0).map(|s| s.tails.share())).unwrap_or(0.0)
        };
        tail(real) < TAILS_ALIKE * tail(&self.structure)
    }

    /// Whether about as much of the targets is lost as in the simulated views.
    pub fn loses_alike(&self, real: &Survey) -> bool {
        let shares = [real, &self.survey].map(lost_share);
        let [less, more] = range(shares);
        more < LOSSES_ALIKE * less + NEGLIGIBLE_DROPOUT
    }

    /// What the simulation shows and the recording does not, in words.
    pub fn too_much(&self, real: &[Structure], level: f64) -> Vec<String> {
        let ours = texture_findings(real, &KnownTerms::default(), level);
        let names = |all: &[TextureFinding]| -> Vec<&'static str> {
            all.iter().filter_map(|h| h.families.first().copied()).collect()
        };
        let shown = names(&ours);
        names(&self.textures)
            .into_iter()
            .filter(|id| !shown.contains(id))
            .map(|id| format!("the simulated recording shows {id}, the real one does not"))
            .collect()
    }
}

/// Largest log ratio of steps that are the same.
const STEPS_ALIKE: f64 = 0.05;
/// Lost shares within this factor, plus this difference, are the same: at the end of the
/// range, what is lost is chance.
const LOSSES_ALIKE: f64 = 1.2;
const NEGLIGIBLE_DROPOUT: f64 = 0.0005;

/// Lost share of all readings asked of the target's pixels.
fn lost_share(survey: &Survey) -> f64 {
    let tiles = || survey.views.iter().flat_map(|v| v.tiles.iter());
    let asked: f64 = tiles().map(|t| t.asked).sum();
    tiles().map(|t| t.asked * t.missing).sum::<f64>() / asked.max(1.0)
}
