//! Files damaged at random, through the library.

use super::*;

/// Where to damage a file, as a share of its length, and with what.
#[derive(Debug, Clone)]
enum Damage {
    Cut(f64),
    Put(Vec<(f64, u8)>),
}

fn damage() -> impl Strategy<Value = Damage> {
    // Digits, signs and brackets damage text more subtly than random bytes do.
    let byte =
        prop_oneof![any::<u8>(), proptest::sample::select(b"0129.-+eE,:[]{}\" \nN".to_vec())];
    prop_oneof![
        1 => (0.0..1.0f64).prop_map(Damage::Cut),
        4 => proptest::collection::vec((0.0..1.0f64, byte), 1..4).prop_map(Damage::Put),
    ]
}

impl Damage {
    fn done_to(&self, bytes: &mut Vec<u8>) {
        let at = |share: f64, length: usize| (share * length as f64) as usize;
        match self {
            Damage::Cut(share) => bytes.truncate(at(*share, bytes.len())),
            Damage::Put(changes) => {
                let length = bytes.len();
                changes.iter().for_each(|(share, byte)| bytes[at(*share, length)] = *byte);
            }
        }
    }
}

/// Four frontal views, so that a fit is fast; every case damages and restores them.
fn small() -> &'static Bench {
    static SMALL: std::sync::OnceLock<Bench> = std::sync::OnceLock::new();
    SMALL.get_or_init(|| {
        let bench = Bench::of(&[1.0, 1.5, 2.0, 3.0], &[0.0]);
        bench.put(
            "0001/view.json",
            "{\"polygon\": [[60.0, 40.0], [99.5, 40.0], [99.5, 80.0], [60.0, 80.0]],\n \"reference_distance_m\": 1.0}\n",
        );
        bench
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 256,
        failure_persistence: None,
        rng_seed: proptest::test_runner::RngSeed::Fixed(7),
        ..ProptestConfig::default()
    })]

    #[test]
    fn no_damage_makes_it_panic(
        file in proptest::sample::select(vec![
            "recording.json", "recording.json", "0000/depth.txt", "0001/view.json", "0000/depth/0000.png",
        ]),
        damage in damage(),
    ) {
        let bench = small();
        let whole = fs::read(bench.file(file)).expect("read");
        let mut bytes = whole.clone();
        damage.done_to(&mut bytes);
        bench.put(file, &bytes);
        let options = kinoise::CalibrateOptions {
            form: Some(kinoise::Form::Khoshelham),
            ..kinoise::CalibrateOptions::default()
        };
        let result = kinoise::io::open(&bench.recording(), &kinoise::io::Assumed::default())
            .and_then(|recording| {
                let views = kinoise::measure_recording(&recording, &options.measure, &|_, _| ())?;
                has_only_numbers("measurements", &kinoise::measure::write_measurements(&views.views));
                kinoise::model_of(&recording, &views, &options)?.model.to_json()
            });
        bench.put(file, whole);
        match result {
            Ok(model) => has_only_numbers("model", &model),
            Err(e) => prop_assert!(!e.to_string().contains('\n'), "{e}"),
        }
    }
}
