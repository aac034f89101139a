use kinoise::diagnose::{Field, Layers};
use kinoise::measure::{MeasureOptions, Workbench};
use kinoise::*;
use rayon::prelude::*;
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let rec = io::open(path.as_ref(), &io::Assumed::default()).unwrap();
    let sigma = match std::env::args().nth(2) {
        Some(m) => NoiseModel::read(m.as_ref()).unwrap().sigma,
        None => SigmaModel::paper(),
    };
    let t = std::time::Instant::now();
    let bench = Workbench::new(&rec.sensor, MeasureOptions::default());
    let fields: Vec<Field> =
        rec.views.par_iter().filter_map(|v| Field::read(v, &bench, &sigma).ok()).collect();
    eprintln!("{} fields {:?}", fields.len(), t.elapsed());
    let mut layer = Layers::of(&fields, &rec.sensor.camera, &bench.rays);
    eprintln!(
        "layer {:?}; inflation {:?}",
        t.elapsed(),
        layer.views.iter().map(|v| (v.inflation * 10.0).round() / 10.0).collect::<Vec<_>>()
    );
    for (name, found) in [
        ("bias", layer.search_bias(0.01, Seed(1))),
        ("variance", layer.search_variance(0.01, Seed(1))),
    ] {
        for f in found {
            println!(
                "{name} {:?} {} {:?} gain {:.1} family {:.1} curve {:.1} thr {:.1} ranking {:?} beta {:.4?}",
                f.candidate.family,
                f.candidate.axis,
                f.candidate.settled,
                f.gain.total,
                f.best_family,
                f.best_curve,
                f.threshold,
                &f.ranking[..2],
                &f.gain.beta.as_slice()[..f.gain.beta.len().min(6)]
            );
        }
    }
    eprintln!("{:?}", t.elapsed());
}
