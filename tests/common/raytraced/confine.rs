//! Causes that act in some views, one region, far away or late only.

use std::sync::Arc;

use rand::Rng;
use rand::seq::SliceRandom;

use super::eye::Site;
use super::kernels::lot;
use super::poses::Plan;
use super::{Act, AtSite, Cause, Cell, Unit};
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

/// Beyond the reach of any set, m.
const FARTHEST_M: f64 = 10.0;

impl Gate {
    /// Draws a gate that leaves several views on either side; `None` where the cell confines nothing.
    pub fn draw(cell: Cell, plans: &[Plan], unit: &Unit, rng: &mut Stream) -> Option<Self> {
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
                all.truncate((plans.len() / 4).max(2));
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

    fn open(&self, site: &Site, plan: &Plan) -> bool {
        match self {
            Gate::Views(views) => views.contains(&plan.view),
            Gate::Columns([from, to]) => (*from..*to).contains(&site.u),
            Gate::Rows([from, to]) => (*from..*to).contains(&site.v),
            Gate::Far(from) => site.z > *from,
            Gate::Late([from, _]) => plan.session_s > *from,
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

    pub fn confine(&self, cause: Cause) -> Result<Cause> {
        let Cause { mut label, act, worth, window } = cause;
        let here = Arc::new(self.clone());
        let only = |f: AtSite, other: f64| -> AtSite {
            Box::new(move |s, plan| if here.open(s, plan) { f(s, plan) } else { other })
        };
        let act = match act {
            Act::Mismatch(f) => Act::Mismatch(only(f, 0.0)),
            Act::Spread(f) => Act::Spread(only(f, 1.0)),
            Act::Gain(f) => Act::Gain(only(f, 1.0)),
            Act::Loss(f) => Act::Loss(only(f, 0.0)),
            _ => {
                return Err(Error::Argument {
                    what: format!("{} cannot be confined", label.form),
                    remedy: "take an effect that acts pixel by pixel",
                });
            }
        };
        let (axes, interval) = self.place();
        (label.also, label.interval) = (axes.iter().map(ToString::to_string).collect(), interval);
        Ok(Cause { label, act, worth, window })
    }
}
