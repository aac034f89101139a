//! Data drawn by the map page's script: discs packed into a few bytes each, and paths.

use std::collections::HashMap;

use base64::prelude::{BASE64_STANDARD, Engine};
use nalgebra::{Isometry3, Vector3};
use serde_json::json;

use super::super::trajectories::Against;
use crate::map::{FrameReport, MapPoint};
use crate::stats::{coprime, quantile, range};

/// Quantiles of sigma between which the colours run, on a logarithmic scale.
const SHOWN: [f64; 2] = [0.02, 0.98];
/// Largest value of a coordinate, stored in 16 bits over the map's extent.
const STEPS: f64 = 65_535.0;
/// Bytes of a point: three coordinates of 16 bits, a normal in two bytes, red, green, blue, sigma, and the
/// spacing of the points.
const BYTES: usize = 13;

/// The scene as JSON; it contains no user text.
pub(super) fn data(
    shown: &[&MapPoint],
    frames: &[FrameReport],
    against: Option<&Against<'_>>,
) -> String {
    let extents = [0, 1, 2].map(|k| range(shown.iter().map(|p| f64::from(p.at[k]))));
    let ends = |e: usize| extents.map(|x| if x[e].is_finite() { x[e] as f32 } else { 0.0 });
    let (sigma, spacing) = (sigmas(shown), Spacing::of(shown, extents));
    let posed: Vec<(f64, &Isometry3<f64>)> =
        frames.iter().filter_map(|f| Some((f.stamp, f.pose.as_ref()?))).collect();
    let begin = posed.first().map_or(0.0, |(stamp, _)| *stamp);
    let seconds: Vec<f64> = posed.iter().map(|(stamp, _)| rounded(stamp - begin)).collect();
    let path: Vec<f64> = posed.iter().flat_map(|(_, pose)| place(pose)).collect();
    let turns: Vec<f64> =
        posed.iter().flat_map(|(_, p)| p.rotation.coords.iter().map(|c| rounded(*c))).collect();
    json!({"low": ends(0), "high": ends(1), "sigma": sigma, "spacing": spacing.ends,
        "seconds": seconds, "path": path, "turns": turns, "truth": truth(against),
        "points": BASE64_STANDARD.encode(packed(shown, extents, sigma, &spacing))})
    .to_string()
}

fn rounded(v: f64) -> f64 {
    (v * 1e3).round() / 1e3
}

fn place(pose: &Isometry3<f64>) -> [f64; 3] {
    let t = &pose.translation;
    [t.x, t.y, t.z].map(rounded)
}

/// The true path in the frame of the map, over the time of the estimate.
fn truth(against: Option<&Against<'_>>) -> Vec<f64> {
    let Some(against) = against else { return Vec::new() };
    let stamps = range(against.estimate.iter().map(|p| p.stamp));
    let map_from_truth = against.evaluation.ate.truth_from_estimate.inverse();
    let within = against.truth.iter().filter(|p| (stamps[0]..=stamps[1]).contains(&p.stamp));
    within.flat_map(|p| place(&(map_from_truth * p.world_from_camera))).collect()
}

/// Range of sigma over which the colours run, m.
fn sigmas(shown: &[&MapPoint]) -> [f64; 2] {
    let positive = shown.iter().map(|p| f64::from(p.sigma)).filter(|s| *s > 0.0 && s.is_finite());
    let mut all: Vec<f64> = positive.collect();
    let [low, high] = SHOWN.map(|q| quantile(&mut all, q).unwrap_or(1e-3));
    [low, high.max(1.1 * low)]
}

/// Spacing of the points around each point, m, and the range that is stored.
struct Spacing {
    each: Vec<f64>,
    ends: [f64; 2],
}

impl Spacing {
    /// Counts points in cells of a hundredth of the map. A surface crossing a cell fills a square of the
    /// cell's side with points. A cell that it only clips has fewer, so the fullest of the cell and its six
    /// neighbours counts.
    fn of(shown: &[&MapPoint], extents: [[f64; 2]; 3]) -> Self {
        const CELLS: f64 = 100.0;
        const FINEST: f64 = 1.0 / 64.0;
        const COARSEST: f64 = 0.5;
        let longest = extents.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        let side = if longest > 0.0 && longest.is_finite() { longest / CELLS } else { 1.0 / CELLS };
        let cell = |p: &MapPoint| [0, 1, 2].map(|k| (f64::from(p.at[k]) / side).floor() as i32);
        let mut counts: HashMap<[i32; 3], u32> = HashMap::new();
        shown.iter().for_each(|p| *counts.entry(cell(p)).or_default() += 1);
        let beside = |[x, y, z]: [i32; 3]| {
            let near =
                [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0; 3]];
            near.map(|[a, b, c]| [x.saturating_add(a), y.saturating_add(b), z.saturating_add(c)])
        };
        let fullest = |p: &MapPoint| {
            let near = beside(cell(p)).into_iter().filter_map(|c| counts.get(&c));
            f64::from(near.copied().max().unwrap_or(1))
        };
        let ends = [FINEST * side, COARSEST * side];
        let each = |p: &&MapPoint| (side / fullest(p).sqrt()).clamp(ends[0], ends[1]);
        Spacing { each: shown.iter().map(each).collect(), ends }
    }
}

/// Packs the points in an order that spreads any first part over the whole map: slow browsers draw only a
/// part while it moves.
fn packed(
    points: &[&MapPoint],
    extents: [[f64; 2]; 3],
    sigma: [f64; 2],
    spacing: &Spacing,
) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(points.len() * BYTES);
    for (point, apart) in spread(points.len()).map(|i| (points[i], spacing.each[i])) {
        for (at, [low, high]) in point.at.iter().zip(extents) {
            let share = (f64::from(*at) - low) / (high - low).max(f64::MIN_POSITIVE);
            bytes.extend_from_slice(&((share * STEPS).round() as u16).to_le_bytes());
        }
        bytes.extend_from_slice(&octahedral(point.normal));
        bytes.extend_from_slice(&point.colour);
        bytes.push(between(f64::from(point.sigma), sigma));
        bytes.push(between(apart, spacing.ends));
    }
    bytes
}

/// Position of a value within a range, on a logarithmic scale of one byte.
fn between(value: f64, [low, high]: [f64; 2]) -> u8 {
    let share = (value / low).ln() / (high / low).ln();
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// All numbers below `n`, each once, in steps of the golden ratio: Weyl's sequence fills evenly.
fn spread(n: usize) -> impl Iterator<Item = usize> {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let step = coprime(((n as f64 * GOLDEN) as usize).max(1), n);
    (0..n).map(move |i| (i as u128 * step as u128 % n as u128) as usize)
}

/// Encodes a direction in two bytes: the octahedron around the sphere, unfolded into a square (Meyer et al.
/// 2010, On floating-point normal vectors).
fn octahedral(normal: Vector3<f32>) -> [u8; 2] {
    let sum = normal.abs().sum();
    if !(sum > 0.0 && sum.is_finite()) {
        return [128, 128];
    }
    let n = normal / sum;
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    let folded = match n.z < 0.0 {
        true => [(1.0 - n.y.abs()) * sign(n.x), (1.0 - n.x.abs()) * sign(n.y)],
        false => [n.x, n.y],
    };
    folded.map(|v| ((0.5 * v + 0.5) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_comes_once_and_a_part_is_spread() {
        for n in [0, 1, 2, 7, 1000, 4096] {
            let mut all: Vec<usize> = spread(n).collect();
            if n == 1000 {
                let mut tens = [0; 10];
                all[..100].iter().for_each(|i| tens[i / 100] += 1);
                // A random hundred would scatter by about three.
                assert!(tens.iter().all(|t| (7..=13).contains(t)), "{tens:?}");
            }
            all.sort_unstable();
            assert!(all.into_iter().eq(0..n), "{n}");
        }
    }

    /// Decodes as the shader does.
    #[test]
    fn normals_come_back_within_a_degree() {
        for i in 0..400 {
            let (a, z) = (f32::from(i as u16) * 0.7, 1.0 - f32::from(i as u16) / 200.0);
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vector3::new(r * a.cos(), r * a.sin(), z);
            let [x, y] = octahedral(n).map(|b| f32::from(b) / 255.0 * 2.0 - 1.0);
            let mut back = Vector3::new(x, y, 1.0 - x.abs() - y.abs());
            if back.z < 0.0 {
                let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
                (back.x, back.y) = ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y));
            }
            let off = back.normalize().angle(&n).to_degrees();
            assert!(off < 1.0, "{n:?}: {off} degrees");
        }
    }

    /// A wall whose points are 5 mm apart on the left and 15 mm on the right.
    #[test]
    fn points_of_a_wall_lie_as_far_apart_as_they_do() {
        let grid = |from: f32, step: f32| {
            let n = (2.0 / step) as i32;
            (0..n * n).map(move |k| [from + (k % n) as f32 * step, (k / n) as f32 * step])
        };
        let point = |[x, y]: [f32; 2]| MapPoint {
            at: Vector3::new(x, y, 8.0 + 0.5 * y),
            normal: Vector3::z(),
            sigma: 0.001,
            colour: [0; 3],
        };
        let wall: Vec<MapPoint> = grid(0.0, 0.005).chain(grid(4.0, 0.015)).map(point).collect();
        let shown: Vec<&MapPoint> = wall.iter().collect();
        let extents = [0, 1, 2].map(|k| range(shown.iter().map(|p| f64::from(p.at[k]))));
        let apart = Spacing::of(&shown, extents);
        let median = |right: bool| {
            let mine = wall.iter().zip(&apart.each).filter(|(p, _)| (p.at.x > 3.0) == right);
            quantile(&mut mine.map(|(_, a)| *a).collect::<Vec<f64>>(), 0.5).unwrap()
        };
        let [left, right] = [median(false), median(true)];
        let as_they_are = (0.004..0.007).contains(&left) && (0.012..0.02).contains(&right);
        assert!(as_they_are, "{left} {right}");
    }
}
