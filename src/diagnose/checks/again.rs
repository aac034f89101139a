//! Runs the battery again, against the extended model: the same layers, thresholds and views, with everything
//! found subtracted from the residuals in memory. Losses and steps of the raw values, which no model changes,
//! are those of the first run.

use super::far_off::far_off;
use crate::diagnose::battery::Battery;
use crate::diagnose::case::Case;
use crate::diagnose::diagnosis::{After, Finding, Remaining, Verdict};
use crate::diagnose::finding::pixels::{subtract_terms, typical_sigma_mm};
use crate::diagnose::verdict::verdict;
use crate::diagnose::views::known::KnownTerms;
use crate::model::{Effect, NoiseModel};
use crate::terms::Term;

impl<'a> Case<'a> {
    /// What stands out against `extended`, and the case with its means restored; the first run `explained` so
    /// many nats.
    pub fn after<'b>(mut self, extended: &'b NoiseModel, explained: f64) -> (After, Case<'b>)
    where
        'a: 'b,
    {
        self.progress.stage("testing the extended model");
        let added = self.added(extended);
        let means: Vec<Vec<f32>> = self.fields.iter().map(|f| f.mean.clone()).collect();
        let mut fields = std::mem::take(&mut self.fields);
        let bias: Vec<Term> = added.bias_terms().cloned().collect();
        subtract_terms(&mut fields, [&bias, &added.variance], self.survey.light, &self.bench);
        let mut case = self.again(fields, extended);
        let battery = case.battery();
        let mut after = after(&battery, explained);
        if battery.found.is_empty()
            && far_off(&case.survey, typical_sigma_mm(&case.fields)).is_some()
        {
            after.verdict = Verdict::Mismatch;
        }
        case.fields.iter_mut().zip(means).for_each(|(field, mean)| field.mean = mean);
        (after, case)
    }

    /// Terms that the extended model adds to the given one.
    fn added(&self, extended: &NoiseModel) -> KnownTerms {
        // Raw values that are ranges were read as such.
        let read = |e: &Effect| self.ranges.is_some() && e.id == "range-not-depth";
        let mut beyond = extended.clone();
        beyond.effects.drain(..self.model.effects.len());
        beyond.effects.retain(|e| !read(e));
        KnownTerms::of(&beyond, &self.sensor().camera)
    }
}

fn after(battery: &Battery, explained: f64) -> After {
    let remaining = |f: &Finding| {
        let name = f.effect.unwrap_or("a curve without a name");
        Remaining {
            statistic: f.statistic,
            axis: f.axis,
            share: f.share / (explained + f.share).max(f64::MIN_POSITIVE),
            p_adjusted: f.p_adjusted,
            words: format!("{name} would still bring {:.0} nats", f.share),
        }
    };
    let Battery { mean, scatter, found, .. } = battery;
    let verdict = verdict(found, [&mean.outcome, &scatter.outcome]);
    After { verdict, remaining: found.iter().map(remaining).collect() }
}
