//! Effects that the model has and the recording does not show.
//!
//! Known effects are subtracted before the search, so an overstated one would pass. Each is compared with the
//! views by what it would do to them. The views are the sample.

use super::textures::beyond;
use crate::diagnose::case::Case;
use crate::diagnose::diagnosis::{Finding, Size};
use crate::diagnose::edges::Edges;
use crate::diagnose::edges::mixing::whole_share;
use crate::diagnose::edges::shadow::{Sides, largest_share};
use crate::diagnose::finding::other_findings::nameless;
use crate::diagnose::finding::pixels::{typical_sigma_mm, typical_sigma_px};
use crate::diagnose::missing::shapes::Step;
use crate::diagnose::noise::mixture::Mixture;
use crate::diagnose::noise::scatter::ScatterResult;
use crate::diagnose::noise::structure::Structure;
use crate::diagnose::noise::tails::SURE_SCALE_ERRORS;
use crate::diagnose::noise::view_mean::{ViewMean, nats, variance_px2};
use crate::diagnose::options::EACH_LEVEL;
use crate::diagnose::steps::contradicted;
use crate::diagnose::views::known::KnownTerms;
use crate::diagnose::views::tiles::Tile;
use crate::terms::{Axis, PixelContext, Statistic};

/// Share of an effect below which the recording contradicts it. Sensors warm up, and views differ.
pub const SHARE: f64 = 0.5;
/// Readings that a view must lose by the model in order to count.
const LOST: f64 = 10.0;

/// An effect of the model, and what the views show of it.
pub struct Claim {
    pub id: &'static str,
    pub statistic: Statistic,
    pub axis: Axis,
    /// Mean over the views; the claim is contradicted below `half`.
    pub seen: ViewMean,
    pub half: f64,
    /// Size in standard deviations of the noise.
    pub size_sigma: f64,
}

impl Case<'_> {
    /// Effects of which the model has more than twice what the views show.
    pub(in crate::diagnose) fn overstated(&self, scatter: &ScatterResult) -> Vec<Finding> {
        // A simulated recording shows what its model does; the two are compared view by view.
        if self.baseline.is_some() {
            return Vec::new();
        }
        let sigma_mm = typical_sigma_mm(&self.fields);
        let level = self.level(EACH_LEVEL);
        let claims = textures(&scatter.structure, &self.known);
        let claims = claims.into_iter().chain(self.tails_claimed(&scatter.structure));
        let claims = claims.chain(self.edges_claimed()).chain(self.losses_claimed());
        let told = |c: Claim| {
            // Probability that views of a sensor with half of the effect show as little.
            let p = c.seen.p_below(c.half);
            let size = Size { mm: c.size_sigma * sigma_mm, sigma: c.size_sigma };
            let finding = finding(&self.known, c.id, c.statistic, c.axis);
            let share = nats(&c.seen, c.half);
            (p < level).then_some(Finding { share, size, p_adjusted: Some(p), ..finding })
        };
        let steps = contradicted(&self.fields, &self.known, self.recording).into_iter();
        let steps = steps.map(|f| Finding {
            share: f.share,
            size: f.size,
            ..finding(&self.known, f.effect.unwrap_or_default(), f.statistic, f.axis)
        });
        claims.filter_map(told).chain(steps).collect()
    }

    fn tails_claimed(&self, views: &[Structure]) -> Option<Claim> {
        let mixture = Mixture::of(&self.known)?;
        let (seen, half) = match mixture.width() {
            // Outliers this frequent are the noise itself, which is as wide as they are.
            width if width > 2.0 => {
                let sigma_px = typical_sigma_px(&self.fields);
                let seen = ViewMean::of(views, |s| Some(s.variance_px2 / sigma_px.powi(2)))?;
                (seen, (1.0 + SHARE * (width - 1.0)).powi(2))
            }
            _ => {
                (ViewMean::of(views, |s| s.tail_share())?, mixture.tail(SHARE, -SURE_SCALE_ERRORS))
            }
        };
        let (statistic, axis) = (Statistic::Distribution, Axis::Residual);
        let size_sigma = mixture.size_sigma();
        Some(Claim { id: "heavy-tails", statistic, axis, seen, half, size_sigma })
    }

    fn edges_claimed(&self) -> Vec<Claim> {
        let edges: Vec<&Edges> = self.fields.iter().map(|f| &f.edges).collect();
        let mixing = self.known.parameter("edge-mixing", "width_px").and_then(|width| {
            let (seen, size_sigma) = whole_share(&edges, width)?;
            let (id, statistic, axis) = ("edge-mixing", Statistic::Bias, Axis::EdgeDistance);
            Some(Claim { id, statistic, axis, seen, half: SHARE, size_sigma })
        });
        let shadow = self.known.parameter("occlusion-shadow", "share").and_then(|share| {
            let sides: Vec<Sides> = edges.iter().map(|e| Sides::of(e, None)).collect();
            let seen = largest_share(&sides)?;
            let (id, statistic, axis) =
                ("occlusion-shadow", Statistic::Dropout, Axis::EdgeDistance);
            let half = SHARE * share;
            (share > 0.0).then_some(Claim { id, statistic, axis, seen, half, size_sigma: 0.0 })
        });
        mixing.into_iter().chain(shadow).collect()
    }

    /// Share of the model's losses that the views show.
    fn losses_claimed(&self) -> Vec<Claim> {
        let of = |step: Step| {
            let expected =
                |(place, t): (&PixelContext, &Tile)| step.loss(step.at(place), 0.0) * t.asked;
            let views = self.survey.views.iter().filter_map(|v| {
                let expected: f64 = v.patches().map(expected).sum();
                let lost: f64 = v.tiles.iter().map(|t| t.missing * t.asked).sum();
                (expected > LOST).then_some((lost / expected, expected))
            });
            let seen = ViewMean::weighed(&views.collect::<Vec<_>>())?;
            let (id, axis, statistic) = (step.family(), step.axis, Statistic::Dropout);
            Some(Claim { id, statistic, axis, seen, half: SHARE, size_sigma: 0.0 })
        };
        Step::known(&self.known).into_iter().filter_map(of).collect()
    }
}

/// Id, parameter and axis of each texture.
const TEXTURES: [(&str, &str, Axis); 6] = [
    ("fixed-pattern-noise", "sigma_px", Axis::Pixel),
    ("row-noise", "sigma_px", Axis::Row),
    ("frame-jitter", "sigma_px", Axis::Frame),
    ("frozen-noise", "fraction", Axis::Frame),
    ("temporal-correlation", "rho", Axis::Frame),
    ("spatial-correlation", "length_px", Axis::PixelLag),
];

fn textures(views: &[Structure], known: &KnownTerms) -> Vec<Claim> {
    let sigma_px = variance_px2(views).sqrt().max(1e-9);
    let one = |&(id, name, axis): &(&'static str, &str, Axis)| {
        let size = known.parameter(id, name).filter(|size| *size > 0.0)?;
        let seen = ViewMean::of(views, beyond(id, known)?)?;
        // The window is compared as a logarithm, the others as variances or shares.
        let (half, size_sigma) = match name {
            "sigma_px" => (-SHARE * size * size, size / sigma_px),
            "length_px" => (SHARE.ln(), 1.0),
            _ => (-SHARE * size, size.sqrt()),
        };
        Some(Claim { id, statistic: Statistic::Correlation, axis, seen, half, size_sigma })
    };
    TEXTURES.iter().filter_map(one).collect()
}

fn finding(known: &KnownTerms, id: &'static str, statistic: Statistic, axis: Axis) -> Finding {
    let shape = format!(
        "the model has {id} ({}), and the views show less than half of it",
        known.in_words(id)
    );
    Finding {
        physics: format!(
            "Too much: {shape}. It belongs to another sensor or to other settings: take it out of the model, or learn the model again."
        ),
        shape: Some(shape),
        contradicted: Some(id),
        ..nameless(statistic, axis)
    }
}
