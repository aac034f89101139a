//! Speed of the simulator. A 640 x 480 frame by formula, with correlated noise and no other effect, must
//! take at most 15 ms on one core (issue 3).

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use kinoise::effects::{Active, CATALOGUE, Instant};
use kinoise::scene::{Bench, Board, Seen, Target};
use kinoise::simulate::{FormulaSensor, kinect_v1};
use kinoise::{Plane, Seed, SigmaModel};

/// Time of one frame with these effects, in a view that has begun.
fn frame(c: &mut Criterion, name: &str, effects: &[&str]) {
    let sensor = kinect_v1(1);
    let rays = sensor.camera.rays();
    let board = Target::Board(Board { width_m: 1.0, height_m: 0.8 });
    let mut bench = Bench::bare(Plane::tilted(1.5, 0.5, 0.3), board);
    bench.wall_m = Some(3.0);
    let seen = Seen::of(&bench, &sensor.camera, &rays);
    let effects: Vec<Active> =
        effects.iter().map(|text| Active::parse(text).expect("an effect")).collect();
    let sigma = SigmaModel::paper();
    let camera = FormulaSensor {
        sensor: &sensor,
        rays: &rays,
        sigma: &sigma,
        effects: &effects,
        seed: Seed(1),
    };
    let mut shooting = camera.begin(&seen);
    let mut number = 0;
    c.bench_function(name, |b| {
        b.iter(|| {
            number += 1;
            let session_s = number as f64 / 30.0;
            shooting.shoot(black_box(Instant {
                view: 0,
                frame: number,
                session_s,
                view_s: session_s,
            }))
        });
    });
}

fn frames(c: &mut Criterion) {
    frame(c, "frame by formula, correlated noise", &["spatial-correlation"]);
    frame(c, "frame by formula, no effect", &[]);
    let all: Vec<&str> = CATALOGUE.iter().map(|e| e.card().id).collect();
    frame(c, "frame by formula, every effect", &all);
}

/// Casting the rays of a view, which is done once per view, not per frame.
fn view(c: &mut Criterion) {
    let sensor = kinect_v1(1);
    let rays = sensor.camera.rays();
    let board = Target::Board(Board { width_m: 1.0, height_m: 0.8 });
    let bench = Bench::bare(Plane::tilted(1.5, 0.5, 0.3), board);
    c.bench_function("what the pixels see of a view", |b| {
        b.iter(|| Seen::of(black_box(&bench), &sensor.camera, &rays));
    });
}

criterion_group!(benches, frames, view);
criterion_main!(benches);
