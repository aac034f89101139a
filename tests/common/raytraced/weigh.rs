//! Finds the strength at which what is concealed is worth a given number of nats.

use super::nats::{Ground, Repeats};
use super::{Cell, Set};
use kinoise::error::Result;

impl Set {
    /// Gives every concealed cause the strength at which knowing it is worth `wanted` nats; without
    /// `wanted`, computes what it is worth as it is.
    pub fn weigh(&mut self, wanted: Option<f64>) -> Result<()> {
        if self.order.cell == Cell::Drift {
            return self.weigh_age(wanted);
        }
        let mut ground = Ground::of(self);
        let mut done = Vec::new();
        // Correlated noise first: it affects the worth of all others.
        let mut turns: Vec<usize> = (0..self.concealed.len()).collect();
        turns.sort_by_key(|k| self.causes[self.known_causes + k].window.is_none());
        for k in turns {
            let mut strength = self.concealed[k].strength;
            let mut nats = ground.nats(&self.at_strength(k, strength)?);
            if let (Some(wanted), Some(_)) = (wanted, nats) {
                let worth = |s| Ok(ground.nats(&self.at_strength(k, s)?).unwrap_or(0.0));
                let (s, got) = strength_for(wanted, worth)?;
                (strength, nats) = (s, Some(got));
            }
            let cause = self.at_strength(k, strength)?;
            if cause.window.is_some() {
                ground.repeats = Repeats::of([&cause]);
            }
            done.push((k, strength, nats, cause));
        }
        for (k, strength, nats, cause) in done {
            (self.concealed[k].strength, self.concealed[k].nats) = (strength, nats);
            self.causes[self.known_causes + k] = cause;
        }
        Ok(())
    }

    fn weigh_age(&mut self, wanted: Option<f64>) -> Result<()> {
        let ground = Ground::of(self);
        let nats = |s| Ok(ground.nats_of_age(&self.described, &self.aged(s)));
        let (strength, got) = match wanted {
            Some(wanted) => strength_for(wanted, nats)?,
            None => (self.order.strength, nats(self.order.strength)?),
        };
        self.unit = self.aged(strength);
        (self.concealed[0].strength, self.concealed[0].nats) = (strength, Some(got));
        Ok(())
    }
}

/// Strength at which `nats` gives what is `wanted`, and its value there; the end of the range where
/// it never does.
pub fn strength_for(wanted: f64, mut nats: impl FnMut(f64) -> Result<f64>) -> Result<(f64, f64)> {
    const WEAKEST: f64 = 1e-6;
    const STRONGEST: f64 = 8.0;
    const NEAR: f64 = 0.02;
    // (ln strength, ln(worth / wanted)) on either side.
    let (mut low, mut high) = (None, None);
    let mut s = 1.0;
    let mut got = nats(s)?;
    for round in 0..40 {
        let at_the_end = got < wanted && s >= STRONGEST || got > wanted && s <= WEAKEST;
        if (got / wanted - 1.0).abs() < NEAR || at_the_end {
            break;
        }
        let here = (f64::ln(s), (got / wanted).max(1e-12).ln());
        *(if got < wanted { &mut low } else { &mut high }) = Some(here);
        // Without a bracket, twice the strength is taken to be worth four times as much.
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
