use kinoise::diagnose::{Field, Outcome, Survey};
use kinoise::measure::{MeasureOptions, Workbench};
use kinoise::terms::{Statistic, Term};
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
        rec.views.par_iter().filter_map(|v| Field::read(v, &bench, &sigma, &Default::default(), 0.0).ok()).collect();
    eprintln!("{} fields {:?}", fields.len(), t.elapsed());
    let survey = Survey::of(&fields, &rec.sensor.camera, &bench.rays);
    eprintln!("survey {:?}", t.elapsed());
    let camera = &rec.sensor.camera;
    let show = |name: &str, o: &Outcome| {
        for (k, c) in o.chosen.iter().enumerate() {
            let basis = format!("{:?}", c.candidate.basis);
            println!(
                "{name} {:?} {} gain {:.1} curve {:.1} p {:.1e} rivals {:?} beta {:.4?}",
                c.candidate.family,
                &basis[..basis.len().min(80)],
                c.gain,
                c.best_curve,
                c.p,
                c.rivals.iter().take(3).map(|r| (r.family, r.gain as i64, r.behind as f32)).collect::<Vec<_>>(),
                &o.coefficients(k)[..c.candidate.basis.count().min(6)]
            );
        }
    };
    let bias = survey.search_bias(camera, 0.01, Seed(1));
    show("bias", &bias);
    eprintln!("bias {:?}", t.elapsed());
    let terms: Vec<Term> = (0..bias.chosen.len())
        .map(|k| Term {
            statistic: Statistic::Bias,
            basis: bias.chosen[k].candidate.basis.clone(),
            coefficients: bias.coefficients(k),
        })
        .collect();
    show("variance", &survey.search_variance(&terms, &sigma, camera, 0.01, Seed(1)));
    eprintln!("{:?}", t.elapsed());
}
