//! What `kinoise simulate` warns of.

use kinoise::SigmaModel;
use kinoise::effects::Active;
use kinoise::simulate::ViewPlan;

use super::common::say;
use super::simulate_scenery::SceneryArguments;

/// Views for which the model does not speak.
pub fn tell_of_clamped(views: &[ViewPlan], sigma: &SigmaModel) {
    let outside = |v: &&ViewPlan| {
        let plane = &v.bench.plane;
        // No recording has a tilt of exactly zero; facing the target is inside all the same.
        let theta = plane.theta().max(sigma.domain.theta_rad[0]);
        !sigma.domain.contains(plane.depth(0.0, 0.0), theta)
    };
    let count = views.iter().filter(outside).count();
    if count > 0 {
        let d = sigma.domain;
        say(format!(
            "note: {count} of {} views lie outside the model's range (z {:.2} to {:.2} m, tilt up to {:.1} degrees); sigma is clamped to its edge there",
            views.len(),
            d.z_m[0],
            d.z_m[1],
            d.theta_rad[1].to_degrees()
        ));
    }
}

/// Effects that have nothing to act on in this scene.
pub fn tell_of_idle(effects: &[Active], scenery: &SceneryArguments) {
    for active in effects {
        let missing = match active.effect.card().id {
            "occlusion-shadow" | "edge-mixing" if scenery.wall.is_none() => {
                "something behind the target (--wall)"
            }
            "intensity-dependent-noise" if !scenery.patches => {
                "a target of several greys (--patches)"
            }
            _ => continue,
        };
        say(format!("note: {} needs {missing} to show much", active.effect.card().id));
    }
}

/// Views in which nothing was measured.
pub fn tell_of_blind(blind: &[String]) {
    for name in blind {
        say(format!(
            "note: view {name} shows no depth: the target is out of the picture or beyond the depth code"
        ));
    }
}
