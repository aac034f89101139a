//! The draw of the demo: a cause and its strength, sealed before the diagnosis, opened after it.

use kinoise::Seed;
use kinoise::diagnose::{Diagnosis, Finding, Status, Verdict};
use kinoise::effects::{Active, CATALOGUE, Card, Parameter};
use kinoise::io::{hex, sha256_hex};
use kinoise::units::{shortest, to_digits};
use rand::Rng;
use serde_json::{Value, json};

/// One effect of the catalogue and its strength.
pub struct Sealed {
    pub effect: Active,
    text: String,
}

/// Range of log2 of the strength over the typical one: from half to twice.
const OCTAVES: std::ops::Range<f64> = -1.0..1.0;

impl Sealed {
    /// Draws an effect of the catalogue, each equally likely. The distance of its strength from none is the
    /// typical one times a factor from half to two (log-uniform); a bias takes either sign. Other parameters
    /// are typical.
    pub fn draw(seed: Seed) -> kinoise::Result<Self> {
        let mut rng = seed.stream("demo/lot");
        let card = CATALOGUE[rng.random_range(0..CATALOGUE.len())].card();
        let Parameter { name, range: [low, high], typical, .. } = card.parameters[0];
        let from_none = (typical - card.identity) * rng.random_range(OCTAVES).exp2();
        let mirrored = card.identity - from_none;
        let either = card.statistic == "bias" && (low..=high).contains(&mirrored);
        let strength = if either && rng.random() { mirrored } else { card.identity + from_none };
        // Rounded to three digits, so that the sealed text is exactly what acts.
        let strength = format!("{:.2e}", strength.clamp(low, high)).parse().unwrap_or(typical);
        let effect = Active::typical(card.id)?.with(name, strength)?;
        let nonce: [u8; 16] = rng.random();
        let text = format!("kinoise demo\neffect {}\nnonce {}\n", effect.argument(), hex(&nonce));
        Ok(Sealed { effect, text })
    }

    pub fn text(&self) -> &str {
        &self.text
    }

    fn hash(&self) -> String {
        sha256_hex(self.text.as_bytes())
    }

    pub fn promise(&self) -> String {
        let all = CATALOGUE.len();
        format!(
            "One of the {all} effects of the catalogue was drawn, and how strong it is, from half to twice its\ntypical size. The diagnosis is not told. This is the SHA-256 of the sealed text:\n  {}",
            self.hash()
        )
    }

    /// Contents of [`super::output::SEAL`], in the format of `sha256sum --check`.
    pub fn promised(&self) -> String {
        format!("{}  sealed.txt\n", self.hash())
    }

    /// Compares the sealed text with the diagnosis, as text and as JSON.
    pub fn opened(&self, diagnosis: &Diagnosis) -> (String, Value) {
        let card = self.effect.effect.card();
        let answer = Answer::of(card.id, diagnosis);
        let parameters: Vec<Compared> = card
            .parameters
            .iter()
            .enumerate()
            .map(|(k, p)| Compared::of(p, self.effect.settings.at(k), answer.finding))
            .collect();
        let mut lines = vec!["\nThe seal is opened:".to_string()];
        lines.extend(self.text.lines().map(|line| format!("  {line}")));
        lines.push(format!("  SHA-256 {}\n", self.hash()));
        lines.push(answer.sentence(card, diagnosis));
        lines.extend(parameters.iter().map(|c| format!("  {}", c.sentence())));
        lines.extend(answer.wrong_names());
        let json = json!({
            "sha256": self.hash(),
            "text": self.text,
            "answer": answer.name(),
            "also_named": answer.others,
            "parameters": parameters.iter().map(Compared::json).collect::<Vec<_>>(),
            "verdict": diagnosis.verdict,
            "gain": diagnosis.heldout.as_ref().map(|h| h.gain),
        });
        (lines.join("\n"), json)
    }
}

/// How close the diagnosis came to the cause.
struct Answer<'a> {
    /// The finding of that name.
    finding: Option<&'a Finding>,
    /// Whether that is the first finding.
    first: bool,
    /// Whether it is a possible name of any finding, with its probability where known.
    among: Option<Option<f64>>,
    /// Whether the verdict is a mismatch.
    mismatch: bool,
    /// Names of other findings, except small remains.
    others: Vec<&'static str>,
}

impl<'a> Answer<'a> {
    fn of(id: &str, diagnosis: &'a Diagnosis) -> Self {
        let claims = || diagnosis.findings.iter().filter(|f| f.status != Status::NotIdentifiable);
        let leads = |f: &&Finding| f.effect == Some(id);
        let finding = claims().find(leads);
        let mut alternatives = claims().flat_map(|f| &f.alternatives);
        let among = alternatives.find(|a| a.effect == id).map(|a| a.probability);
        let others = claims().filter(|f| !f.minor && !leads(f)).filter_map(|f| f.effect);
        Answer {
            finding,
            first: claims().next().is_some_and(|f| leads(&f)),
            among,
            mismatch: diagnosis.verdict == Verdict::Mismatch,
            others: others.collect(),
        }
    }

    /// Name of the outcome in the JSON.
    fn name(&self) -> &'static str {
        match (self.finding, self.among) {
            (Some(_), _) if self.first => "first",
            (Some(_), _) => "found",
            (None, Some(_)) => "among",
            (None, None) if self.mismatch => "other",
            (None, None) => "missed",
        }
    }

    fn sentence(&self, card: &Card, diagnosis: &Diagnosis) -> String {
        let id = card.id;
        match self.name() {
            "first" => format!("Right: {id} is the first finding."),
            "found" => format!("Half right: {id} was found, but not first."),
            "among" => {
                let p = self.among.flatten().map(|p| format!(", with {:.0} %", 100.0 * p));
                let p = p.unwrap_or_default();
                format!("Half right: {id} is among the possible causes{p}.")
            }
            "other" => {
                format!("Wrong: something was found, but not called {id}. {}", why(id, diagnosis))
            }
            _ => format!("Missed: {id} was not found. {}", why(id, diagnosis)),
        }
    }

    fn wrong_names(&self) -> Option<String> {
        let list = self.others.join(", ");
        (!self.others.is_empty()).then(|| format!("Named too, and not there: {list}."))
    }
}

/// What the diagnosis itself says about an effect that it did not name.
fn why(id: &str, diagnosis: &Diagnosis) -> String {
    if let Some(blind) = diagnosis.cannot_tell.iter().find(|c| c.effect == id) {
        return format!("It says that it cannot tell: {}.", blind.why);
    }
    let minimum = diagnosis.detectable.iter().find(|d| d.effect == id).map(|d| &d.minimum);
    minimum.map_or_else(String::new, |minimum| {
        let each =
            minimum.iter().filter_map(|(name, v)| Some(format!("{name} {}", digits(v.as_f64()?))));
        let each: Vec<String> = each.collect();
        format!("By its own account it would see it from {} on.", each.join(", "))
    })
}

/// A parameter's true and found values.
struct Compared {
    name: &'static str,
    truth: f64,
    found: Option<f64>,
    interval: Option<[f64; 2]>,
}

impl Compared {
    fn of(p: &Parameter, truth: f64, finding: Option<&Finding>) -> Self {
        let said = finding.and_then(|f| f.parameters.get(p.name));
        let number = |key: &str| said?.get(key)?.as_f64();
        let found = number("value");
        let interval =
            found.zip(number("std_error")).map(|(v, e)| [v - NORMAL_95 * e, v + NORMAL_95 * e]);
        Compared { name: p.name, truth, found, interval }
    }

    fn covers(&self) -> Option<bool> {
        self.interval.map(|[low, high]| (low..=high).contains(&self.truth))
    }

    fn sentence(&self) -> String {
        let (name, truth) = (self.name, digits(self.truth));
        let Some(found) = self.found.map(digits) else {
            return format!("{name}: {truth} was sealed; the diagnosis gives no number");
        };
        let interval = self.interval.map_or_else(String::new, |[low, high]| {
            let holds = if self.covers() == Some(true) { "holds" } else { "does not hold" };
            format!(" (95 %: {} to {}, which {holds} the truth)", digits(low), digits(high))
        });
        format!("{name}: {truth} was sealed, {found} was found{interval}")
    }

    fn json(&self) -> Value {
        json!({"name": self.name, "sealed": self.truth, "found": self.found,
            "interval": self.interval, "covered": self.covers()})
    }
}

/// Two-sided 95 % quantile of a Gaussian.
const NORMAL_95: f64 = 1.96;

fn digits(v: f64) -> String {
    shortest(to_digits(v, 3))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_lot_reaches_every_effect_and_repeats_with_its_seed() {
        let drawn: Vec<Sealed> = (0..600).map(|n| Sealed::draw(Seed(n)).expect("a draw")).collect();
        let ids: BTreeSet<&str> = drawn.iter().map(|s| s.effect.effect.card().id).collect();
        // The probability that 600 draws miss any of the 29: 29 (28/29)^600 = 2e-8.
        assert_eq!(ids.len(), CATALOGUE.len());
        assert!(drawn.iter().all(|s| !s.effect.is_identity()));
        let again = Sealed::draw(Seed(7)).expect("a draw");
        assert_eq!((again.text(), again.hash()), (drawn[7].text(), drawn[7].hash()));
        let hashes: BTreeSet<String> = drawn.iter().map(Sealed::hash).collect();
        assert_eq!(hashes.len(), drawn.len());
    }

    /// The sealed text describes exactly the effect that acts.
    #[test]
    fn the_sealed_text_reads_back() {
        for seed in 0..200 {
            let sealed = Sealed::draw(Seed(seed)).expect("a draw");
            let line = sealed.text().lines().nth(1).and_then(|l| l.strip_prefix("effect "));
            let read = Active::parse(line.expect("an effect")).expect("it parses");
            assert_eq!(read.settings, sealed.effect.settings, "{}", sealed.text());
        }
    }
}
