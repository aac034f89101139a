//! Speed of the speckle simulator. The budget is 0.5 s for a 640 x 480 frame on one core.

use criterion::{Criterion, criterion_group, criterion_main};
use kinoise::effects::Instant;
use kinoise::scene::{Bench, Target};
use kinoise::simulate::kinect_v1;
use kinoise::simulate::speckle::{Causes, SpeckleSensor};
use kinoise::{Plane, Seed};

fn frames(c: &mut Criterion) {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one");
    let sensor = SpeckleSensor::new(&kinect_v1(1), Causes::default()).unwrap();
    let bench = Bench::bare(Plane::tilted(1.5, 0.5, 0.0), Target::Wall);
    let at = |frame| Instant { view: 0, frame, session_s: 0.0, view_s: 0.0 };
    let mut group = c.benchmark_group("speckle, 640 x 480, one core");
    group.sample_size(20);
    group.bench_function("pattern and reference", |b| {
        b.iter(|| SpeckleSensor::new(&kinect_v1(1), Causes::default()).unwrap());
    });
    group.bench_function("first frame of a view", |b| {
        b.iter(|| one.install(|| sensor.begin(&bench, Seed(1)).shoot(at(0))));
    });
    let mut filming = sensor.begin(&bench, Seed(1));
    filming.shoot(at(0));
    group.bench_function("each further frame", |b| b.iter(|| one.install(|| filming.shoot(at(1)))));
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
