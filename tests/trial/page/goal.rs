//! One figure with its marks, and the table of all.

use maud::{Markup, html};

use super::words::{of, percent, percents, ratio};
use crate::{Level, Rate};
use kinoise::report::numbers::ABSENT;

/// What a mark asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Bound {
    AtMost(f64),
    AtLeast(f64),
    Within([f64; 2]),
}

impl Bound {
    fn holds(self, value: f64) -> bool {
        match self {
            Bound::AtMost(most) => value <= most,
            Bound::AtLeast(least) => value >= least,
            Bound::Within([low, high]) => (low..=high).contains(&value),
        }
    }

    fn words(self, share: bool) -> String {
        let number = |v| if share { percent(v) } else { ratio(v) };
        match self {
            Bound::AtMost(most) => format!("≤\u{a0}{}", number(most)),
            Bound::AtLeast(least) => format!("≥\u{a0}{}", number(least)),
            Bound::Within(ends) if share => percents(ends),
            Bound::Within([low, high]) => format!("{} to {}", number(low), number(high)),
        }
    }
}

/// One figure and its marks.
pub(super) struct Goal {
    pub what: &'static str,
    pub value: Option<f64>,
    /// Told in percent.
    share: bool,
    /// Counts and interval of a share.
    rate: Option<Rate>,
    good: Option<Bound>,
    extraordinary: Bound,
}

impl Goal {
    /// `None` where nothing was measured.
    pub fn reached(&self) -> Option<Level> {
        let value = self.value.filter(|v| v.is_finite())?;
        let good = self.good.is_some_and(|b| b.holds(value));
        Some(match (self.extraordinary.holds(value), good) {
            (true, _) => Level::Extraordinary,
            (_, true) => Level::Good,
            _ => Level::Neither,
        })
    }

    /// `1 of 9, which is 11 % (95 % interval 0.3 to 48 %); asked for: ≤ 5 %`.
    pub fn in_words(&self) -> String {
        let asked = self.good.unwrap_or(self.extraordinary).words(self.share);
        match (&self.rate, self.value) {
            (Some(r), _) => {
                let interval = percents(r.interval);
                let share = percent(r.rate);
                format!(
                    "{}, which is {share} (95 % interval {interval}); asked for: {asked}",
                    of(r)
                )
            }
            (None, Some(value)) => format!("{}; asked for: {asked}", ratio(value)),
            (None, None) => "not measured".into(),
        }
    }
}

pub(super) fn share(
    what: &'static str,
    rate: Option<Rate>,
    good: Option<Bound>,
    best: Bound,
) -> Goal {
    Goal { what, value: rate.map(|r| r.rate), share: true, rate, good, extraordinary: best }
}

pub(super) fn figure(
    what: &'static str,
    value: Option<f64>,
    good: Option<Bound>,
    best: Bound,
) -> Goal {
    Goal { what, value, share: false, rate: None, good, extraordinary: best }
}

pub(super) fn least(good: f64) -> Option<Bound> {
    Some(Bound::AtLeast(good))
}

pub(super) fn most(good: f64) -> Option<Bound> {
    Some(Bound::AtMost(good))
}

pub(super) fn level_badge(reached: Option<Level>) -> Markup {
    let (class, word) = match reached {
        None => ("none", "not measured"),
        Some(Level::Neither) => ("bad", "missed"),
        Some(Level::Good) => ("good", "good"),
        Some(Level::Extraordinary) => ("best", "extraordinary"),
    };
    html! { span class={ "badge " (class) } { (word) } }
}

/// Every mark with its figure.
pub(super) fn table(goals: &[Goal]) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "Figure" } th.n { "Value" } th.n { "k of n" } th.n { "95 % interval" }
                th.n { "Good" } th.n { "Extraordinary" } th { "Reached" }
            } }
            tbody { @for goal in goals { (row(goal)) } }
        } }
    }
}

fn row(goal: &Goal) -> Markup {
    let share = goal.share;
    let number = |v: f64| if share { percent(v) } else { ratio(v) };
    html! {
        tr {
            td { (goal.what) }
            td.n { (goal.value.map_or(ABSENT.into(), number)) }
            td.n { (goal.rate.map_or(ABSENT.into(), |r| of(&r))) }
            td.n { (goal.rate.map_or(ABSENT.into(), |r| percents(r.interval))) }
            td.n { (goal.good.map_or(ABSENT.into(), |b| b.words(share))) }
            td.n { (goal.extraordinary.words(share)) }
            td { (level_badge(goal.reached())) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_reached_on_its_border_and_nothing_measured_is_not_a_miss() {
        let goal = |value| figure("x", value, most(0.15), Bound::AtMost(0.07));
        assert_eq!(goal(Some(0.07)).reached(), Some(Level::Extraordinary));
        assert_eq!(goal(Some(0.15)).reached(), Some(Level::Good));
        assert_eq!(goal(Some(0.16)).reached(), Some(Level::Neither));
        assert_eq!(goal(None).reached(), None);
        let rate = Rate::of((0..9).map(|i| i == 0));
        let alarm = share("x", rate, most(0.05), Bound::AtMost(0.02));
        assert_eq!(
            alarm.in_words().replace('\u{a0}', " "),
            "1 of 9, which is 11 % (95 % interval 0.3 to 48 %); asked for: ≤ 5 %"
        );
    }
}
