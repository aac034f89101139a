use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::diagnose::diagnosis::Alternative;
use crate::diagnose::missing::shapes::Step;
use crate::diagnose::search::candidate::Candidate;
use crate::diagnose::search::layer_null::LayerNull;
use crate::diagnose::search::outcome::Rival;
use crate::diagnose::views::samples::ViewData;
use crate::diagnose::views::surveyed_view::MEAN_PRECISION;
use crate::model::{Domain, Form, PAPER_EQ1, SigmaModel};
use crate::rng::Stream;
use crate::simulate::kinect_v1;
use crate::terms::{Axis, Basis, Coordinate, Extent, Modulation, PixelContext, Statistic, Term};
use crate::view::Sensor;

const WALL_M: [f64; 2] = [20.0, 20.0];
const BOARD_M: [f64; 2] = [1.0, 0.8];
const NAMES: [&str; 2] = ["radial-disparity-bias", "range-not-depth"];

/// A sensor in front of a target of this size, m.
struct Stand {
    sensor: Sensor,
    sigma: SigmaModel,
    reach: Extent,
    lost: Vec<Step>,
    last: PixelContext,
}

impl Stand {
    fn of([width, height]: [f64; 2]) -> Self {
        let domain = Domain { z_m: [0.3, 9.0], theta_rad: [0.0, 1.3] };
        let [right, down] = [width, height].map(|size| [-0.5 * size, 0.5 * size]);
        Stand {
            sensor: kinect_v1(4),
            sigma: SigmaModel::published(Form::Paper, &PAPER_EQ1, domain),
            reach: Extent { right, down, edge: 100.0, ..Extent::default() },
            lost: Vec::new(),
            last: PixelContext::default(),
        }
    }

    fn with<T>(&self, of: impl FnOnce(&Outlook<'_>) -> T) -> T {
        let rays = self.sensor.camera.rays();
        of(&Outlook {
            statistic: Statistic::Bias,
            camera: &self.sensor.camera,
            rays: &rays,
            scale_px_m: self.sensor.disparity_px_m().unwrap(),
            sigma: &self.sigma,
            reach: &self.reach,
            rim_px: 0.0,
            last: self.last,
            lost: &self.lost,
            worth: 0.02,
            precision: MEAN_PRECISION.to_vec(),
        })
    }
}

/// Two bowls that frontal views cannot tell apart: one fixed in the picture and one that changes with the
/// distance, which are the same while the target stays at one distance.
fn bases() -> [Basis; 2] {
    [0.0, 1.0].map(|p| Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(p)))
}

/// A search that ended with the first of two names, the other close behind.
fn in_doubt() -> Outcome {
    let rival = |(family, basis)| Rival { family, basis, gain: 20.0, behind: 0.0 };
    let rivals: Vec<Rival> = NAMES.into_iter().zip(bases()).map(rival).collect();
    let chosen = Chosen {
        candidate: Candidate::named(NAMES[0], rivals[0].basis.clone()),
        rms: 0.01,
        adequacy: 0.6,
        gain: 20.0,
        best_curve: 20.0,
        rivals,
        p: 0.001,
    };
    Outcome { chosen: vec![chosen], noise: LayerNull::unknown(), ..Outcome::default() }
}

fn stated(p: [f64; 2]) -> Vec<Alternative> {
    let of = |(effect, p)| Alternative { effect, probability: Some(p) };
    NAMES.into_iter().zip(p).map(of).collect()
}

/// A bowl of `k` px at the corner's radius, by the first or the second name.
fn bowl(which: usize, k: f64) -> Term {
    Term { statistic: Statistic::Bias, basis: bases()[which].clone(), coefficients: vec![k] }
}

/// The view with the term's bias, and noise of `sigmas` times the standard deviation of the weights.
fn recorded(mut view: ViewData, term: &Term, sigmas: f64, rng: &mut Stream) -> ViewData {
    for ((y, place), w) in view.response.iter_mut().zip(view.places.iter()).zip(&view.weight) {
        let white: f64 = StandardNormal.sample(rng);
        *y = term.value(place) + sigmas * white / w.sqrt();
    }
    view
}

fn frontal(outlook: &Outlook<'_>, term: &Term, sigmas: f64, rng: &mut Stream) -> Vec<ViewData> {
    let views = [0.95, 1.0, 1.0, 1.1, 1.05].map(|z| outlook.view(&Plane::tilted(z, 0.0, 0.0)));
    views.into_iter().flatten().map(|view| recorded(view, term, sigmas, rng)).collect()
}

/// Prospects for a noise-free bowl of `k` px, and how far apart the names are now.
fn advised(size: [f64; 2], k: f64) -> (Vec<NextView>, f64) {
    let (outcome, seed) = (in_doubt(), Seed(3));
    Stand::of(size).with(|outlook| {
        let views = frontal(outlook, &bowl(0, k), 0.0, &mut seed.stream("test"));
        let of = (Statistic::Bias, &views[..]);
        let contest = Contest::of(of, &outcome, &outcome.chosen[0], &stated([0.6, 0.39])).unwrap();
        (prospects(&contest, outlook, seed), contest.separation(&contest.information))
    })
}

#[test]
fn what_frontal_views_confuse_asks_for_another_distance_or_tilt() {
    let (all, now) = advised(WALL_M, 0.05);
    let best = &all[0];
    assert!(now < 3.0 && best.separation_then > 2.0 * now, "{now} {best:?}");
    // Nearly as often as one of the two names is right.
    assert!(best.chance > 0.9, "{best:?}");
    // No view settles a cause that is hardly there.
    let (all, _) = advised(WALL_M, 0.0005);
    assert!(all.iter().all(|p| p.chance < 0.1), "{:?}", all[0]);
}

/// A small board far away fills little of the picture.
#[test]
fn a_small_board_promises_less_and_is_asked_for_near_by() {
    let [wall, board] = [WALL_M, BOARD_M].map(|size| advised(size, 0.03).0.swap_remove(0));
    assert!(
        board.z_m < wall.z_m && board.separation_then < wall.separation_then,
        "{wall:?} {board:?}"
    );
}

/// For a frontal board this depends on the focal length alone.
#[test]
fn the_edge_is_as_far_as_it_is_in_the_picture() {
    let stand = Stand::of(BOARD_M);
    let f = stand.sensor.camera.fx;
    stand.with(|outlook| {
        let view = outlook.view(&Plane::tilted(2.0, 0.0, 0.0)).unwrap();
        for p in view.places.iter() {
            let expected = f / 2.0 * (0.5 - p.right.abs()).min(0.4 - p.down.abs());
            // Rays are single precision.
            approx::assert_relative_eq!(p.edge, expected.min(100.0), epsilon = 1e-4);
        }
    });
}

/// No view is suggested where nearly all depth was lost, and the room's light stays as it was.
#[test]
fn a_view_is_asked_for_where_depth_comes_back_and_in_the_light_there_is() {
    let [open, cut] = [None, Some(Step::whole(Axis::Z, 3.0, 0.05))].map(|lost| Stand {
        lost: lost.into_iter().collect(),
        last: PixelContext { ambient: 300.0, temperature_c: 25.0, ..PixelContext::default() },
        ..Stand::of(BOARD_M)
    });
    let weight = |stand: &Stand, z: f64| {
        let view = stand.with(|outlook| outlook.view(&Plane::tilted(z, 0.0, 0.0)))?;
        assert!(view.places.iter().all(|p| p.ambient == 300.0 && p.temperature_c == 25.0));
        Some(view.weight.iter().sum::<f64>())
    };
    let near = weight(&cut, 2.0).unwrap() / weight(&open, 2.0).unwrap();
    let midst = weight(&cut, 3.0).unwrap() / weight(&open, 3.0).unwrap();
    assert!((near - 1.0).abs() < 1e-6 && (midst - 0.5).abs() < 1e-6, "{near} {midst}");
    assert!(weight(&open, 4.0).is_some() && weight(&cut, 4.0).is_none());
}

/// With either name true and with noise, one more view settles a name in doubt as often as predicted,
/// within three standard errors.
#[test]
fn a_view_settles_the_name_as_often_as_promised() {
    let (outcome, stand) = (in_doubt(), Stand::of(WALL_M));
    let (mut promised, mut kept, mut variance) = (0.0, 0.0, 0.0);
    stand.with(|outlook| {
        for seed in 0..80 {
            let mut rng = Seed(seed).stream("test");
            let truth = (seed % 2) as usize;
            let term = bowl(truth, 0.03);
            let views = frontal(outlook, &term, 1.0, &mut rng);
            let of = (Statistic::Bias, &views[..]);
            let contest = Contest::of(of, &outcome, &outcome.chosen[0], &stated([0.5, 0.5]));
            let now = contest.unwrap().now;
            if now[0].max(now[1]) >= SURE {
                continue;
            }
            let now = stated([now[0], now[1]]);
            let contest = Contest::of(of, &outcome, &outcome.chosen[0], &now).unwrap();
            let another = outlook.view(&Plane::tilted(1.8, 0.0, 0.0)).unwrap();
            let another = recorded(another, &term, 1.0, &mut rng);
            let more = evidence_of_bases(&[another], &contest.bases).pop().unwrap();
            let p = contest.chance(&more.a, rng);
            let settled = contest.sure_with(&more) == Some(truth);
            promised += p;
            variance += p * (1.0 - p);
            kept += f64::from(u8::from(settled));
        }
    });
    assert!(variance > 4.0, "too few doubts: {promised} {kept} {variance}");
    assert!((kept - promised).abs() < 3.0 * variance.sqrt(), "{promised} {kept} {variance}");
}
