//! How strong what is concealed must be to be worth so much.

use super::choices::{age, cause};
use super::ground::{Ground, Repeats};
use super::{Cause, Cell, Set, Trace, Unit};
use kinoise::error::Result;
use kinoise::rng::Stream;

/// A cause that the model does not know.
#[derive(Debug, Clone)]
pub(super) struct Concealed {
    pub name: String,
    /// What it is drawn from, so that it can be drawn again at another strength.
    pub start: Stream,
    pub strength: f64,
    /// What knowing of it is worth; `None` where that was not asked or cannot be said.
    pub nats: Option<f64>,
}

impl Set {
    /// The `k`th concealed cause as it would be at another strength.
    fn at(&self, k: usize, strength: f64) -> Result<Cause> {
        let Concealed { name, start, .. } = &self.concealed[k];
        let strengths = [strength, strength.min(1.0)];
        let cause =
            cause(name, strengths, &self.unit, &self.session, self.seed, &mut start.clone())?;
        match &self.gate {
            Some(gate) => gate.confine(cause),
            None => Ok(cause),
        }
    }

    /// The described unit, so much older.
    fn aged(&self, strength: f64) -> Unit {
        let mut unit = self.described.clone();
        age(&mut unit, strength, &mut self.concealed[0].start.clone());
        unit
    }

    /// Give every concealed cause the strength at which knowing of it is worth `wanted` nats; where
    /// nothing is wanted, say what it is worth.
    ///
    /// # Errors
    /// Those of [`Set::draw`].
    pub(super) fn weigh(&mut self, wanted: Option<f64>) -> Result<()> {
        if self.order.cell == Cell::Drift {
            return self.weigh_age(wanted);
        }
        let mut ground = Ground::of(self);
        let mut done = Vec::new();
        // Whether neighbours err together counts for all others.
        let mut turns: Vec<usize> = (0..self.concealed.len()).collect();
        let windowed = |k: &usize| matches!(self.concealed_cause(*k).trace, Trace::Window { .. });
        turns.sort_by_key(|k| !windowed(k));
        for k in turns {
            let cause = self.at(k, self.concealed[k].strength)?;
            let mut told = (self.concealed[k].strength, ground.nats(&cause));
            if let (Some(wanted), Some(_)) = (wanted, told.1) {
                let nats = |s| Ok(ground.nats(&self.at(k, s)?).unwrap_or(0.0));
                let (s, got) = strength_for(wanted, nats)?;
                told = (s, Some(got));
            }
            let cause = self.at(k, told.0)?;
            if matches!(cause.trace, Trace::Window { .. }) {
                ground.repeats = Repeats::of([&cause]);
            }
            done.push((k, told, cause));
        }
        for (k, (strength, nats), cause) in done {
            let (known, concealed) = (self.known_causes, &mut self.concealed[k]);
            (concealed.strength, concealed.nats) = (strength, nats);
            self.causes[known + k] = cause;
        }
        Ok(())
    }

    /// Strength and nats of every concealed cause; NaN where that cannot be said.
    pub fn told(&self) -> Vec<(f64, f64)> {
        self.concealed.iter().map(|c| (c.strength, c.nats.unwrap_or(f64::NAN))).collect()
    }

    fn concealed_cause(&self, k: usize) -> &Cause {
        &self.causes[self.known_causes + k]
    }

    fn weigh_age(&mut self, wanted: Option<f64>) -> Result<()> {
        let ground = Ground::of(self);
        let nats = |s| {
            let unit = self.aged(s);
            Ok(ground.nats_of_age(&|z, theta| unit.sigma(z, theta)))
        };
        let (strength, got) = match wanted {
            Some(wanted) => strength_for(wanted, nats)?,
            None => (self.order.strength, nats(self.order.strength)?),
        };
        self.unit = self.aged(strength);
        (self.concealed[0].strength, self.concealed[0].nats) = (strength, Some(got));
        Ok(())
    }
}

/// The strength at which `nats` gives what is `wanted`, and what it gives there; the strongest there
/// is where it never does.
///
/// # Errors
/// Those of `nats`.
pub(super) fn strength_for<E>(
    wanted: f64,
    mut nats: impl FnMut(f64) -> Result<f64, E>,
) -> Result<(f64, f64), E> {
    const WEAKEST: f64 = 1e-6;
    const STRONGEST: f64 = 8.0;
    const NEAR: f64 = 0.02;
    // ln of the strength, and ln of what it is worth over what is wanted.
    let (mut low, mut high) = (None, None);
    let mut s = 1.0;
    let mut got = nats(s)?;
    for round in 0..40 {
        let at_the_end = got < wanted && s >= STRONGEST || got > wanted && s <= WEAKEST;
        if (got / wanted - 1.0).abs() < NEAR || at_the_end {
            break;
        }
        let here = (f64::ln(s), (got / wanted).max(1e-12).ln());
        if got < wanted {
            low = Some(here)
        } else {
            high = Some(here)
        }
        // Twice the strength is worth four times as much, unless a bracket says otherwise.
        let alone = |(s, off): (f64, f64)| s - (0.5 * off).clamp(-2.5, 2.5);
        let next = match (low, high) {
            (Some(l), Some(h)) if round % 3 == 2 || l.1 < -10.0 => 0.5 * (l.0 + h.0),
            (Some(l), Some(h)) => l.0 + (h.0 - l.0) * (-l.1 / (h.1 - l.1)).clamp(0.05, 0.95),
            (Some(end), None) | (None, Some(end)) => alone(end),
            (None, None) => 0.0,
        };
        s = next.exp().clamp(WEAKEST, STRONGEST);
        got = nats(s)?;
    }
    Ok((s, got))
}
