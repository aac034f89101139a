//! A set of rays as the trial asks for it: strength by detectability, the truth apart.

use std::path::Path;

use serde_json::{Map, json};

use super::question::{Asked, ExamView, Hidden, Pose, Sealed, Truth};
use super::{Cause, Cell, Order, Set, exam, write};
use kinoise::error::{Error, Result};
use kinoise::io::sha256_hex;

/// Every cell that this world has.
pub const CELLS: [Cell; 13] = [
    Cell::Null,
    Cell::Drift,
    Cell::Single,
    Cell::Pair,
    Cell::Triple,
    Cell::Outside,
    Cell::Blind,
    Cell::Referenced,
    Cell::Mimic,
    Cell::FewViews,
    Cell::Region,
    Cell::Far,
    Cell::Late,
];

/// The set that is `asked`. The same seed gives the same recording but for the strength of what is
/// concealed.
///
/// # Errors
/// When this world has no such cell or effect.
pub fn seal(asked: &Asked) -> Result<Box<dyn Sealed>> {
    Ok(Box::new(Rays { set: Set::sealed(asked, None, None)?, asked: asked.clone() }))
}

impl Set {
    /// The set that is `asked`, with so many views and frames; by lot where none are given.
    ///
    /// # Errors
    /// When this world has no such cell or effect.
    pub fn sealed(asked: &Asked, views: Option<usize>, frames: Option<usize>) -> Result<Self> {
        if !CELLS.contains(&asked.cell) {
            return Err(Error::Argument {
                what: format!("the world of rays has no cell {:?}", asked.cell),
                remedy: "take that of real recordings",
            });
        }
        let Asked { cell, seed, small, .. } = *asked;
        let text = format!("sealed/{cell:?}/{:?}/{seed}/{small}", asked.names);
        let effects = asked.names.clone();
        let order = Order { cell, effects, strength: 1.0, seed, views, frames, small };
        let mut set = Set::of(order, if small { 160 } else { 320 }, &text)?;
        set.name = sha256_hex(format!("opaque {text}/{:?}", asked.nats).as_bytes())[..10].into();
        // What nobody can see has no strength at which it is seen.
        set.weigh(asked.nats.filter(|_| cell != Cell::Blind))?;
        Ok(set)
    }

    fn hidden(&self) -> Vec<Hidden> {
        if self.order.cell == Cell::Drift {
            let parameters =
                Map::from_iter([("sigma".to_string(), json!(self.unit.sigma.to_vec()))]);
            return vec![Hidden {
                names: Vec::new(),
                form: "recalibrate".into(),
                statistic: "variance".into(),
                axis: "z".into(),
                also: Vec::new(),
                interval: None,
                parameters,
                nats: self.concealed[0].nats,
            }];
        }
        let concealed = self.causes[self.known_causes..].iter().zip(&self.concealed);
        concealed.map(|(cause, told)| hidden(cause, told.nats)).collect()
    }
}

fn hidden(Cause { label, .. }: &Cause, nats: Option<f64>) -> Hidden {
    Hidden {
        names: label.id.iter().map(ToString::to_string).collect(),
        form: label.form.into(),
        statistic: label.statistic.into(),
        axis: label.axis.into(),
        also: label.also.iter().map(ToString::to_string).collect(),
        interval: label.interval,
        parameters: label.parameters.clone(),
        nats,
    }
}

struct Rays {
    set: Set,
    asked: Asked,
}

impl Sealed for Rays {
    fn truth(&self) -> Truth {
        Truth { asked: self.asked.clone(), hidden: self.set.hidden(), base: self.set.base() }
    }

    fn write(&self, folder: &Path) -> Result<()> {
        write::recording(&self.set, &folder.join("recording"))?;
        self.set.described.model(self.set.known.clone())?.write(&folder.join("model.json"))
    }

    fn exam(&self) -> Vec<ExamView> {
        exam::views(&self.set)
    }

    fn with_view(&self, pose: &Pose) -> Result<Option<(Pose, Box<dyn Sealed>)>> {
        let mut set = Set::sealed(&self.asked, None, None)?;
        let taken = set.add_view(pose);
        Ok(Some((taken, Box::new(Rays { set, asked: self.asked.clone() }))))
    }
}
