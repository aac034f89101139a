use super::*;
use crate::model::{Domain, Form, PAPER_EQ1};
use crate::simulate::kinect_v1;
use crate::terms::{Basis, Coordinate, Modulation, PixelContext};

fn sigma() -> SigmaModel {
    let domain = Domain { z_m: [0.3, 9.0], theta_rad: [0.0, 1.3] };
    SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
}

/// Of a target of this size, m.
fn reach([width, height]: [f64; 2]) -> Extent {
    let [right, down] = [width, height].map(|size| [-0.5 * size, 0.5 * size]);
    Extent { right, down, edge: 100.0, ..Extent::default() }
}

fn term(basis: Basis, coefficients: Vec<f64>) -> Term {
    Term { statistic: Statistic::Bias, basis, coefficients }
}

const WALL_M: [f64; 2] = [20.0, 20.0];
const BOARD_M: [f64; 2] = [1.0, 0.8];

/// Frontal views, and what is asked of another.
fn confused(best: &Term, rival: &Term, size: [f64; 2]) -> (Prospects, Prospects) {
    let sensor = kinect_v1(4);
    let (camera, rays, sigma, reach) = (&sensor.camera, sensor.camera.rays(), sigma(), reach(size));
    let outlook = Outlook {
        statistic: Statistic::Bias,
        camera,
        rays: &rays,
        scale_px_m: sensor.disparity_px_m().unwrap(),
        sigma: &sigma,
        reach: &reach,
        worth: 0.02,
        precision: vec![0.0; 3],
    };
    let frontal: Vec<ViewData> =
        [0.9, 1.3].iter().filter_map(|&z| outlook.view(&Plane::tilted(z, 0.0, 0.0))).collect();
    assert!(frontal[0].places.iter().all(|p: &PixelContext| p.z > 0.0));
    let there = prospects(&frontal, best, rival, &outlook);
    let alone = prospects(&[], best, rival, &outlook);
    (there, alone)
}

/// What frontal views cannot tell: a bowl that stands still in the picture, and one that goes
/// with the ray's angle to the surface, which is the same bowl while the target is faced.
#[test]
fn a_bowl_and_the_angle_of_incidence_ask_for_a_tilted_view() {
    let (bowl, incidence) = (bowl_of(0.2), incidence());
    let lens = term(
        Basis::powers(Coordinate::RaySquared, 1, Modulation::RadialSlope { fx: 145.0, fy: 145.0 }),
        vec![0.05],
    );
    let (there, _) = confused(&bowl, &incidence, WALL_M);
    let best = there.best().unwrap();
    assert!(best.separation > 2.0 * there.now, "{} {best:?}", there.now);
    // A lens shows on tilted planes alone.
    let (there, _) = confused(&lens, &bowl, WALL_M);
    let best = there.best().unwrap();
    assert!(there.now < 1e-6 && best.separation > 2.0, "{} {best:?}", there.now);
    assert!(best.theta_rad > 0.4, "{best:?}");
}

#[test]
fn the_advised_view_separates_more_than_most() {
    let bow = term(Basis::relief(2), vec![0.02, 0.02, 0.0]);
    let bowl =
        term(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(0.0)), vec![0.0; 2]);
    for (best, rival) in [(&bow, &bowl), (&bowl_of(0.2), &bow)] {
        let (there, alone) = confused(best, rival, BOARD_M);
        let mut all: Vec<f32> = there.views.iter().map(|p| p.separation as f32).collect();
        let median = f64::from(crate::stats::median_in_place(&mut all));
        let most = there.best().unwrap();
        assert!(most.separation > 1.2 * median, "{} {median} {most:?}", there.now);
        assert!(there.views.iter().all(|p| p.separation >= there.now - 1e-6));
        // Views taken hold the rival down: the same view alone tells less.
        assert!(alone.best().unwrap().separation <= most.separation + 1e-6);
    }
}

/// Of a small board far away little is left in the picture: what a wall would tell there, it
/// cannot.
#[test]
fn a_small_board_is_asked_for_near_by() {
    let (bowl, incidence) = (bowl_of(0.2), incidence());
    let [wall, board] =
        [WALL_M, [0.6, 0.5]].map(|size| confused(&bowl, &incidence, size).0.best().copied());
    let (wall, board) = (wall.unwrap(), board.unwrap());
    assert!(board.separation < wall.separation && board.z_m <= wall.z_m, "{wall:?} {board:?}");
}

fn incidence() -> Term {
    term(Basis::powers(Coordinate::RadiusSquared, 2, Modulation::power(1.0)), vec![0.0; 2])
}

fn bowl_of(k: f64) -> Term {
    term(Basis::powers(Coordinate::RadiusSquared, 1, Modulation::power(0.0)), vec![k])
}
