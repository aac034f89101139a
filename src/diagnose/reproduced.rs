//! What can be done with a finding: simulate it, or take it out of depth images.

use super::diagnosis::{Finding, Status};
use crate::camera::Camera;
use crate::effects::{self, Active, Effect, Settings};
use crate::terms::Term;

impl Finding {
    /// Whether `correct` takes it out of depth images: the model holds terms that can be subtracted, or a
    /// formula that can be inverted.
    pub fn is_corrected(&self) -> bool {
        let held = self.of_some.is_none() && self.contradicted.is_none();
        held && match &self.terms[..] {
            [] => self.has_inverse() && self.has_strength(),
            terms => terms.iter().any(Term::is_correctable),
        }
    }

    fn has_inverse(&self) -> bool {
        let any = Camera::centred(640, 480, 585.0);
        let inverse = |e: &dyn Effect| e.inverse(&Settings::typical(e.card()), &any);
        self.effect.and_then(effects::find).and_then(inverse).is_some()
    }

    /// Whether the strength of its effect was measured; the model holds an effect without one by its name alone.
    pub fn has_strength(&self) -> bool {
        let card = self.effect.and_then(effects::find).map(|e| e.card());
        let strength = card.and_then(|c| c.parameters.first());
        strength.is_none_or(|p| self.value(p.name).is_some())
    }

    /// Effect of the catalogue that reproduces this finding in the simulator, with typical values for
    /// parameters that were not measured. `None` without a name, and where the strength is unknown or outside
    /// the formula's range.
    pub fn as_effect(&self) -> Option<Active> {
        let named = matches!(self.status, Status::Named | Status::OneOf);
        let mut active = Active::typical(self.effect.filter(|_| named)?).ok()?;
        let card = active.effect.card();
        for (n, knob) in card.parameters.iter().enumerate() {
            let [low, high] = knob.range;
            match self.value(knob.name) {
                Some(v) if n > 0 => active = active.with(knob.name, v.clamp(low, high)).ok()?,
                Some(v) => active = active.with(knob.name, v).ok()?,
                // An unstated share is the whole.
                None if n == 0 && knob.name != "share" => return None,
                None => {}
            }
        }
        Some(active)
    }
}
