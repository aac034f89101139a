//! Which world makes a set.

use std::fs;
use std::path::Path;

use serde_json::{Map, Value};

use super::question::{Asked, Cell, Hidden, Sealed, Truth};
use super::rays;
use crate::error::{Error, Result};

/// Make what is asked for. `data` is a folder of real recordings.
///
/// # Errors
/// When the world has no such set.
pub fn seal(asked: &Asked, _data: Option<&Path>) -> Result<Box<dyn Sealed>> {
    let cell = match asked.cell {
        Cell::Null | Cell::Halves => rays::Cell::Null,
        Cell::Drift => rays::Cell::Drift,
        Cell::Pair | Cell::Triple | Cell::Mimic => rays::Cell::Pair,
        Cell::Outside => rays::Cell::Outside,
        Cell::Blind => rays::Cell::Blind,
        _ => rays::Cell::Single,
    };
    let order = rays::Order {
        cell,
        effects: asked.names.clone(),
        strength: asked.nats.map_or(1.0, |n| (n / 50.0).powf(0.4)),
        seed: asked.seed,
        views: None,
        frames: None,
        small: asked.small,
    };
    Ok(Box::new(Rays { asked: asked.clone(), set: rays::Set::draw(order)? }))
}

struct Rays {
    asked: Asked,
    set: rays::Set,
}

impl Sealed for Rays {
    fn truth(&self) -> Truth {
        let old = self.set.truth();
        let text = |v: &Value, key: &str| v[key].as_str().unwrap_or_default().to_string();
        let hidden = old["effects"].as_array().into_iter().flatten().map(|e| Hidden {
            names: e["id"].as_str().map(String::from).into_iter().collect(),
            form: text(e, "form"),
            statistic: text(e, "statistic"),
            axis: text(e, "axis"),
            also: serde_json::from_value(e["also"].clone()).unwrap_or_default(),
            interval: serde_json::from_value(e["interval"].clone()).unwrap_or_default(),
            parameters: e["parameters"].as_object().cloned().unwrap_or_else(Map::new),
            nats: None,
        });
        Truth { asked: self.asked.clone(), hidden: hidden.collect(), base: old["base"].clone() }
    }

    fn write(&self, folder: &Path) -> Result<()> {
        let root = folder.with_extension("raw");
        rays::write(&self.set, &root)?;
        fs::create_dir_all(folder).map_err(|e| Error::write(folder, e))?;
        let model = format!("model/{}.json", self.set.name);
        for (from, to) in [(self.set.name.as_str(), "recording"), (&model, "model.json")] {
            fs::rename(root.join(from), folder.join(to)).map_err(|e| Error::write(folder, e))?;
        }
        fs::remove_dir_all(&root).map_err(|e| Error::write(&root, e))
    }
}
