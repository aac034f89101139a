//! Causes that act in some views, one region, far away or late only.

use rand::Rng;
use rand::seq::SliceRandom;

use super::eye::Site;
use super::kernels::lot;
use super::nats::{Ground, Looked};
use super::poses::Plan;
use super::question::Hidden;
use super::{Act, Cause, Cell, Unit};
use kinoise::error::{Error, Result};
use kinoise::rng::Stream;

/// Where a cause acts.
#[derive(Debug, Clone)]
pub enum Gate {
    Views(Vec<usize>),
    /// px.
    Columns([f64; 2]),
    /// px.
    Rows([f64; 2]),
    /// Beyond this depth, m.
    Far(f64),
    /// From the first of these session times to the session's end, s.
    Late([f64; 2]),
}

/// The `count` views nearest to the tilts or distances on which a cause shows; all where it shows on all.
fn fittest(label: &Hidden, plans: &[Plan], count: usize) -> Vec<usize> {
    let at = |plan: &Plan| match label.axis.as_str() {
        "theta" => Some(plan.stage.theta),
        "z" => Some(plan.stage.board.depth(0.0, 0.0)),
        _ => None,
    };
    let off = |plan: &Plan| {
        label.interval.zip(at(plan)).map_or(0.0, |([low, high], x)| (low - x).max(x - high))
    };
    let mut off: Vec<(f64, usize)> = plans.iter().map(off).zip(0..).collect();
    off.sort_by(|a, b| a.0.total_cmp(&b.0));
    let last = off.get(count - 1).map_or(f64::INFINITY, |o| o.0);
    off.into_iter().filter(|o| o.0 <= last).map(|o| o.1).collect()
}

/// Beyond the reach of any set, m.
const FARTHEST_M: f64 = 10.0;

impl Gate {
    /// Draws a gate that leaves several views on either side; `None` where the cell confines nothing.
    /// Few views are such as can show the first of the `causes`.
    pub fn draw(
        cell: Cell,
        plans: &[Plan],
        unit: &Unit,
        causes: &[Cause],
        rng: &mut Stream,
    ) -> Option<Self> {
        // Midway between two views, as long as there are enough views.
        let mut between = |of: &dyn Fn(&Plan) -> f64| {
            let mut at: Vec<f64> = plans.iter().map(of).collect();
            at.sort_by(f64::total_cmp);
            let k = (rng.random_range(0.5..0.7) * at.len() as f64) as usize;
            let k = k.clamp(1, at.len().max(2) - 1);
            0.5 * (at[k - 1] + at[k.min(at.len() - 1)])
        };
        Some(match cell {
            Cell::Far => Gate::Far(between(&|p| p.stage.board.depth(0.0, 0.0))),
            Cell::Late => {
                let last = plans.iter().map(|p| p.session_s).fold(0.0, f64::max);
                Gate::Late([between(&|p| p.session_s), last])
            }
            Cell::FewViews => {
                let mut all: Vec<usize> = (0..plans.len()).collect();
                all.shuffle(rng);
                let few = (plans.len() / 4).max(2);
                if let Some(cause) = causes.first() {
                    let fit = fittest(&cause.label, plans, (plans.len() / 2).max(few));
                    all.retain(|view| fit.contains(view));
                }
                all.truncate(few);
                all.sort_unstable();
                Gate::Views(all)
            }
            Cell::Region => {
                let camera = &unit.sensor.camera;
                let columns = lot(&[true, false], rng);
                let size = if columns { camera.width } else { camera.height } as f64;
                let from = rng.random_range(0.1..0.5) * size;
                let band = [from, from + rng.random_range(0.3..0.4) * size].map(f64::round);
                if columns { Gate::Columns(band) } else { Gate::Rows(band) }
            }
            _ => return None,
        })
    }

    /// Whether it lets anything of this view through.
    fn opens_in(&self, plan: &Plan) -> bool {
        match self {
            Gate::Views(views) => views.contains(&plan.view),
            Gate::Late([from, _]) => plan.session_s > *from,
            _ => true,
        }
    }

    fn open(&self, site: &Site, plan: &Plan) -> bool {
        match self {
            Gate::Columns([from, to]) => (*from..*to).contains(&site.u),
            Gate::Rows([from, to]) => (*from..*to).contains(&site.v),
            Gate::Far(from) => site.z > *from,
            _ => self.opens_in(plan),
        }
    }

    /// The axes that it confines, and the interval on the first of them.
    fn place(&self) -> (&'static [&'static str], Option<[f64; 2]>) {
        match self {
            Gate::Views(_) => (&[], None),
            Gate::Columns(band) => (&["column", "pixel"], Some(*band)),
            Gate::Rows(band) => (&["row", "pixel"], Some(*band)),
            Gate::Far(from) => (&["z"], Some([*from, FARTHEST_M])),
            Gate::Late(times) => (&["session-time"], Some(*times)),
        }
    }

    /// The samples that it lets through.
    fn within<'a>(&self, ground: &Ground<'a>) -> Ground<'a> {
        let within = |look: &Looked<'a>| {
            let open = look.samples.iter().filter(|s| self.open(&s.site, look.plan()));
            Looked { eye: look.eye, samples: open.copied().collect() }
        };
        Ground { views: ground.views.iter().map(within).collect(), ..*ground }
    }

    pub fn confine(&self, mut cause: Cause) -> Result<Cause> {
        let of_pixels =
            matches!(cause.act, Act::Mismatch(_) | Act::Spread(_) | Act::Gain(_) | Act::Loss(_));
        let of_views = matches!(self, Gate::Views(_) | Gate::Late(_));
        if !of_pixels && !of_views {
            return Err(Error::Argument {
                what: format!("{} cannot be confined to a part of a view", cause.label.form),
                remedy: "take an effect that acts pixel by pixel, or the cell few-views or late",
            });
        }
        let (axes, interval) = self.place();
        cause.label.also.splice(0..0, axes.iter().map(ToString::to_string));
        cause.label.interval = interval.or(cause.label.interval);
        Ok(Cause { only: Some(self.clone()), ..cause })
    }
}

impl Cause {
    /// Whether it acts anywhere in this view.
    pub fn acts_in(&self, plan: &Plan) -> bool {
        self.only.as_ref().is_none_or(|gate| gate.opens_in(plan))
    }

    pub fn acts_at(&self, site: &Site, plan: &Plan) -> bool {
        self.only.as_ref().is_none_or(|gate| gate.open(site, plan))
    }

    /// `worth` of the samples where it acts.
    pub fn where_it_acts(&self, ground: &Ground<'_>, worth: impl Fn(&Ground<'_>) -> f64) -> f64 {
        self.only.as_ref().map_or_else(|| worth(ground), |gate| worth(&gate.within(ground)))
    }
}
