//! Is there a shadow beside the target, in all views on one side, and as wide as it must be?
//!
//! The band that the projector cannot light is as many pixels wide as the disparity falls from the
//! target's edge to what is behind: fx b (1/z - 1/z_behind), on the side away from the projector.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::diagnosis::Curve;
use super::edges::{Beside, Edges};
use super::null::student;

/// Losses beside the target.
#[derive(Debug, Clone)]
pub struct Band {
    /// 0 left of the target, 1 right of it.
    pub side: usize,
    /// As wide as the geometry has it, and on one side.
    pub lawful: bool,
    /// Of what the geometry has, and its standard error.
    pub share: [f64; 2],
    /// Nats of a share of the geometry's width, and of one width everywhere.
    pub gain: [f64; 2],
    pub p: f64,
    pub curve: Curve,
}

const FEWEST_VIEWS: usize = 3;
/// The other side has less than this share of it.
const OTHER_SIDE: f64 = 0.4;
/// A shadow is no wider than this share of what geometry has: pixels that see both surfaces are
/// lost beside it.
const WIDEST: f64 = 1.4;
/// One view's border is known to this, px: its rows err alike.
const BORDER_PX: f64 = 0.7;
/// A name must explain this share of what the best curve does.
const ADEQUATE: f64 = 0.6;

/// What a view has left and right of the target; `None` where too little is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sides(pub [Option<Beside>; 2]);

impl Sides {
    /// What is lost beyond what a twin loses, where there is one.
    pub fn of(edges: &Edges, twin: Option<&Edges>) -> Self {
        let side = |side: usize| {
            let own = edges.beside(side)?;
            let Some(twin) = twin else { return Some(own) };
            let expected = twin.beside(side)?;
            Some(Beside { lost: own.lost - expected.lost * own.rows / expected.rows, ..own })
        };
        Sides([side(0), side(1)])
    }
}

struct Law {
    share: f64,
    std_error: f64,
    freedom: f64,
}

/// What is lost as a share of `of`, view by view. A small shadow says little; views differ for reasons of
/// their own, so that a large one does not say all.
fn law(views: &[Beside], of: impl Fn(&Beside) -> f64) -> Law {
    let usual = views.iter().map(&of).sum::<f64>() / views.len() as f64;
    let weighed: Vec<[f64; 2]> =
        views.iter().map(|v| [of(v) / (of(v) + usual), v.lost / of(v)]).collect();
    let all: f64 = weighed.iter().map(|[w, _]| w).sum();
    let share = weighed.iter().map(|[w, share]| w * share).sum::<f64>() / all;
    let off: f64 = weighed.iter().map(|[w, own]| (w * (own - share)).powi(2)).sum();
    let n = (all * all / weighed.iter().map(|[w, _]| w * w).sum::<f64>()).max(1.5);
    Law { share, std_error: (off * n / (n - 1.0)).sqrt() / all, freedom: n - 1.0 }
}

impl Law {
    fn t(&self) -> f64 {
        // Without any loss there is neither a share nor an error.
        if self.share > 0.0 { self.share / self.std_error.max(1e-9 * self.share) } else { 0.0 }
    }

    /// What it is worth: a share that the views agree on, and whole pixels that are explained.
    fn nats(&self, views: &[Beside], of: impl Fn(&Beside) -> f64) -> f64 {
        let square = |px: f64, v: &Beside| (px / v.rows / BORDER_PX).powi(2);
        let explained = |v: &Beside| square(v.lost, v) - square(v.lost - self.share * of(v), v);
        student(0.5 * self.t().powi(2), self.freedom)
            + 0.5 * views.iter().map(explained).sum::<f64>()
    }
}

/// The band that the views agree on, if there is one at this level.
pub fn band(views: &[Sides], level: f64) -> Option<Band> {
    let seen = |side: usize| -> Vec<Beside> { views.iter().filter_map(|s| s.0[side]).collect() };
    let sides = [seen(0), seen(1)];
    let share = |side: usize| {
        let views = &sides[side];
        if views.len() < FEWEST_VIEWS { 0.0 } else { law(views, |v| v.shaded).share }
    };
    let side = usize::from(share(1) > share(0));
    let views = &sides[side];
    if views.len() < FEWEST_VIEWS {
        return None;
    }
    let lawful = law(views, |v| v.shaded);
    let even = law(views, |v| v.rows);
    let t = StudentsT::new(0.0, 1.0, lawful.freedom).ok()?;
    // Two sides were looked at.
    let p = (2.0 * t.sf(lawful.t())).min(1.0);
    if p > level {
        return None;
    }
    let one_sided = share(1 - side) < OTHER_SIDE * lawful.share;
    let gain = [lawful.nats(views, |v| v.shaded), even.nats(views, |v| v.rows)];
    Some(Band {
        side,
        lawful: one_sided && lawful.share < WIDEST && gain[0] > ADEQUATE * gain[1],
        share: [lawful.share, lawful.std_error],
        gain,
        p,
        curve: curve(views, &lawful),
    })
}

fn curve(views: &[Beside], law: &Law) -> Curve {
    let mut widths: Vec<[f64; 2]> =
        views.iter().map(|v| [v.shaded, v.lost].map(|px| px / v.rows)).collect();
    widths.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let model: Vec<f64> = widths.iter().map(|w| law.share * w[0]).collect();
    let off: f64 = widths.iter().zip(&model).map(|(w, m)| (w[1] - m).powi(2)).sum();
    let scatter = (off / (widths.len() as f64 - 1.0)).sqrt();
    Curve {
        x_label: "disparity from the target's border to what is behind, px".into(),
        y_label: "width without a measurement beside the border, px".into(),
        x: widths.iter().map(|w| w[0]).collect(),
        y: widths.iter().map(|w| w[1]).collect(),
        y_std_error: vec![scatter; widths.len()],
        model,
    }
}
