//! What went wrong on the way, in words.

use std::collections::BTreeMap;

use super::tracker::{Fate, FrameReport};

/// A camera that never went farther than this was not moved, m: a tenth of a Kinect's noise.
const STILL_M: f64 = 2e-4;

/// Of all frames.
pub fn remarks(frames: &[FrameReport]) -> Vec<String> {
    [lost(frames), undetermined(frames), repeated(frames), still(frames)]
        .into_iter()
        .flatten()
        .collect()
}

fn lost(frames: &[FrameReport]) -> Option<String> {
    let lost: Vec<(&FrameReport, &String)> = frames
        .iter()
        .filter_map(|f| match &f.fate {
            Fate::Lost(why) => Some((f, why)),
            _ => None,
        })
        .collect();
    let (first, why) = lost.first()?;
    let end = if frames.last().is_some_and(|f| f.pose.is_none()) {
        "; the last frames are among them: the trajectory ends early"
    } else {
        ""
    };
    Some(format!(
        "lost in {} of {} frames, first at {:.6}: {why}{end}",
        lost.len(),
        frames.len(),
        first.stamp
    ))
}

fn undetermined(frames: &[FrameReport]) -> Option<String> {
    let mut names: BTreeMap<String, usize> = BTreeMap::new();
    for name in frames.iter().flat_map(|f| f.undetermined.iter().map(ToString::to_string)) {
        *names.entry(name).or_default() += 1;
    }
    let any = frames.iter().filter(|f| !f.undetermined.is_empty()).count();
    let mut listed: Vec<(String, usize)> = names.into_iter().collect();
    listed.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    let words: Vec<String> = listed.iter().map(|(name, n)| format!("{name} ({n})")).collect();
    (any > 0).then(|| {
        format!(
            "in {any} of {} frames depth does not determine the whole motion: {}; along these the start was kept",
            frames.len(),
            words.join(", ")
        )
    })
}

fn repeated(frames: &[FrameReport]) -> Option<String> {
    let n = frames.iter().filter(|f| f.repeated).count();
    (n > 0).then(|| {
        format!(
            "{n} of {} depth images are the one before, bit by bit: a frozen driver?",
            frames.len()
        )
    })
}

fn still(frames: &[FrameReport]) -> Option<String> {
    let far =
        frames.iter().filter_map(|f| Some(f.pose?.translation.vector.norm())).fold(0.0, f64::max);
    (frames.len() > 1 && far < STILL_M).then(|| "the camera never moved".to_string())
}

/// What is known of each frame, a row each: fate, standard deviations of the pose (m and rad),
/// iterations, share of matched points, what depth does not determine.
pub fn frames_csv(frames: &[FrameReport]) -> String {
    let mut text = String::from(
        "timestamp,fate,sigma_x_m,sigma_y_m,sigma_z_m,sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,iterations,matched,pairs,rms_m,weakest,undetermined\n",
    );
    for frame in frames {
        let fate = match &frame.fate {
            Fate::First => "first",
            Fate::Tracked => "tracked",
            Fate::Lost(_) => "lost",
        };
        let sigma = |k: usize| {
            frame
                .covariance
                .map(|c| format!("{:.3e}", c[(k, k)].max(0.0).sqrt()))
                .unwrap_or_default()
        };
        let sigmas: Vec<String> = (0..6).map(sigma).collect();
        let names: Vec<String> = frame.undetermined.iter().map(ToString::to_string).collect();
        text.push_str(&format!(
            "{:.6},{fate},{},{},{:.4},{},{:.6},{:.5},{}\n",
            frame.stamp,
            sigmas.join(","),
            frame.iterations,
            frame.matched,
            frame.pairs,
            frame.rms_m,
            frame.weakest,
            names.join("; ")
        ));
    }
    text
}
