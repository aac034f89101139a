//! Time of a frame of the filmed office at 640 x 480 on one core; the target is 60 ms for colour and depth.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use kinoise::io::{encode_png16_quickly, encode_rgb};
use kinoise::simulate::Physics;
use kinoise::simulate::room::{Film, Room, RoomCamera, Shutter, around_the_desks};
use kinoise::{Seed, SigmaModel};

/// Stride through the frames of the default path: views from all sides.
const STRIDE: usize = 75;

fn frames(c: &mut Criterion) {
    let film = Film {
        sensor: Film::kinect(1),
        room: Room::office(Seed(1)),
        poses: around_the_desks().into_iter().step_by(STRIDE).collect(),
        physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
        seed: Seed(1),
    };
    let rays = film.sensor.camera.rays();
    let mut shutter = Shutter::new(&film, &film.sensor, &rays).unwrap();
    let camera = RoomCamera::new(&film.room, &film.sensor.camera, &rays);
    let mut group = c.benchmark_group("room");
    group.sample_size(20);
    let mut k = 0;
    let mut next = || {
        k = (k + 1) % film.poses.len();
        k
    };
    group.bench_function("picture", |b| {
        b.iter(|| black_box(camera.take(&film.poses[next()].world_from_camera)));
    });
    group.bench_function("picture_and_depth", |b| {
        b.iter(|| {
            let k = next();
            black_box(shutter.shoot(k..k + 1))
        });
    });
    let (picture, depth) = shutter.shoot(0..1).remove(0);
    group.bench_function("encode_colour", |b| {
        b.iter(|| black_box(encode_rgb(depth.width, depth.height, &picture.rgb).unwrap()));
    });
    group.bench_function("encode_depth", |b| {
        b.iter(|| black_box(encode_png16_quickly(&depth).unwrap()))
    });
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
