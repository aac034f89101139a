//! Time to map ten frames of the filmed office at 640 x 480 on one core, decoding included, ms. The targets
//! are ratios to peers run beside it (tests/tools/peer.py in ../shared/peers/bench.py).

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use kinoise::io::Assumed;
use kinoise::map::{Init, Method, Options, Weights, map};
use kinoise::sequence::open;
use kinoise::simulate::Physics;
use kinoise::simulate::room::{Film, Room, around_the_desks};
use kinoise::{NoiseModel, Seed, SigmaModel};

const FRAMES: usize = 10;

fn frames(c: &mut Criterion) {
    let film = Film {
        sensor: Film::kinect(1),
        room: Room::office(Seed(1)),
        poses: around_the_desks().into_iter().take(FRAMES).collect(),
        physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
        seed: Seed(1),
    };
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("film");
    film.write(&root, &|_, _| ()).unwrap();
    let sequence = open(&root, &Assumed::default()).unwrap();
    let model = NoiseModel::paper();
    let one = one_thread();
    let mut group = c.benchmark_group("map");
    group.sample_size(10);
    let best = Options { colour: false, ..Options::best() };
    let paper = |weights| Options { colour: false, ..Options::paper(weights, Init::None) };
    for (name, options) in [
        ("paper_plain", paper(Weights::None)),
        ("paper_weighted", paper(Weights::Model)),
        ("projective", Options { method: Method::Projective, ..best }),
        ("frame_to_map", best),
    ] {
        group.bench_function(name, |b| {
            b.iter(|| {
                let run = || map(&sequence, &model, &options, &|_, _| ()).unwrap();
                black_box(one.install(run))
            });
        });
    }
    group.finish();
}

fn one_thread() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap()
}

criterion_group!(benches, frames);
criterion_main!(benches);
