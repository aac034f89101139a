//! Where diagnosis and simulator meet: the views worth seeing, each with its simulated twin.

use kinoise::camera::Rays;
use kinoise::diagnose::{Diagnosed, Field, ViewPictures, pictures};
use kinoise::effects::{Active, Instant};
use kinoise::report::Picture;
use kinoise::simulate::{FormulaSensor, plan_on};
use kinoise::view::ViewNotes;
use kinoise::{Frame, NoiseModel, Seed, Sensor};

/// More frames of a twin than this add nothing that an eye sees.
const MAX_FRAMES: usize = 16;

/// `given` is the model that the recording was held against.
pub fn of(done: &Diagnosed, sensor: &Sensor, given: &NoiseModel, seed: Seed) -> Vec<Picture> {
    let rays = sensor.camera.rays();
    let effects = effects(&done.model);
    let twin = Twin { sensor, rays: &rays, model: &done.model, effects: &effects, seed };
    let session_s = done.fields.iter().map(|f| f.time_s).fold(f64::INFINITY, f64::min);
    // Beside a simulated recording, what is shown is a difference already.
    let retake = |index, field: &Field| {
        if done.against.is_empty() { twin.frames(index, field, session_s) } else { None }
    };
    pictures(done, sensor, given, &retake).into_iter().map(|p| picture(p, done)).collect()
}

/// What moves the plane as a whole: a picture about the plane does not show it.
const OF_THE_PLANE: [&str; 3] = ["depth-scale", "disparity-offset", "thermal-drift"];

/// All that the simulator knows how to make.
fn effects(model: &NoiseModel) -> Vec<Active> {
    let mut known = model.effects.clone();
    known.retain(|e| {
        let id = e.id.as_str();
        !OF_THE_PLANE.contains(&id) && Active::all_of_model(std::slice::from_ref(e)).is_ok()
    });
    Active::all_of_model(&known).unwrap_or_default()
}

struct Twin<'a> {
    sensor: &'a Sensor,
    rays: &'a Rays,
    model: &'a NoiseModel,
    effects: &'a [Active],
    seed: Seed,
}

impl Twin<'_> {
    fn frames(&self, index: usize, field: &Field, session_s: f64) -> Option<Vec<(f64, Frame)>> {
        let times = field.frames.iter().take(MAX_FRAMES).map(|f| f.0);
        let stamps = times.map(|t| field.time_s + t).collect();
        let notes = ViewNotes {
            temperature_c: field.temperature_c,
            ambient_lux: field.ambient_lux,
            ..ViewNotes::default()
        };
        let plan = plan_on(&field.name, &field.plane, &field.pixels, self.rays, stamps, notes);
        let seen = plan.seen(&self.sensor.camera, self.rays);
        let camera = FormulaSensor {
            sensor: self.sensor,
            rays: self.rays,
            sigma: &self.model.sigma,
            effects: self.effects,
            seed: self.seed,
        };
        let mut shooting = camera.begin(&seen).under(plan.ambient_lux).at(plan.notes.temperature_c);
        let shot = |(_, instant): (f64, Instant)| (instant.view_s, shooting.shoot(instant).depth);
        Some(plan.instants(index, session_s).map(shot).collect())
    }
}

fn picture(p: ViewPictures, done: &Diagnosed) -> Picture {
    let line = &done.diagnosis.views[p.view];
    let tilt = line.theta_rad.to_degrees();
    let range = p.range_px();
    let beyond = if done.against.is_empty() { "" } else { ", recorded minus simulated" };
    Picture {
        caption: format!(
            "View {}{beyond}: board at {:.2} m, tilted {tilt:.0}°; mean of {} frame{}",
            line.name,
            line.z_m,
            line.frames,
            if line.frames == 1 { "" } else { "s" }
        ),
        width: p.width,
        height: p.height,
        before: p.before,
        after: p.after,
        simulated: p.twin,
        unit: "px",
        range,
    }
}
