//! Clock offsets: between depth and colour in a film, and between a film and its ground truth.

use crate::common;
use crate::map::kinoise;

/// The depth stamps of freiburg1_rpy lag the motion capture by 25 to 30 ms: most of the rotation error is
/// not the mapper's.
#[test]
fn the_clock_of_freiburg1_rpy_is_found() {
    let Some(film) = common::data("tum_fr1_rpy_a") else { return };
    let dir = tempfile::tempdir().unwrap();
    let (film, out) = (film.to_str().unwrap(), dir.path().join("out"));
    let (code, said) = kinoise(&["map", film, "-o", out.to_str().unwrap()]);
    assert_eq!(code, 0, "{said}");
    let evaluated = |options: &[&str]| {
        let arguments =
            [&["evaluate", "--truth", film, "--estimate", out.to_str().unwrap()], options].concat();
        kinoise(&arguments)
    };
    let degrees = |said: &str| -> f64 {
        let line = said.lines().find(|l| l.contains("degrees: rmse")).expect("told");
        line.split_whitespace().nth(6).expect("a number").parse().expect("a number")
    };
    let (code, plain) = evaluated(&[]);
    assert_eq!(code, 0, "{plain}");
    assert!(plain.contains("ms ahead of the truth's"), "{plain}");
    let (code, set) = evaluated(&["--offset", "auto"]);
    assert_eq!(code, 0, "{set}");
    let line = set.lines().find(|l| l.contains("clock is set by")).expect("told");
    let ms: f64 = line.split_whitespace().rev().nth(1).unwrap().parse().expect("a number");
    assert!((-30.0..-20.0).contains(&ms), "{line}");
    assert!(degrees(&plain) > 3.0 && degrees(&set) < 2.4, "{plain}\n{set}");
}

/// A camera that nods and shakes; the depth images are stamped 12 ms late, or not at all late.
#[cfg(feature = "opencv")]
#[test]
fn clocks_of_depth_and_colour_that_disagree_are_told() {
    use crate::map::{best, film, mapped};
    use kinoise::io::Assumed;
    use kinoise::map::{Init, Options};
    use kinoise::sequence::open;
    use kinoise::simulate::room::{Pose, around_the_desks};
    use nalgebra::{Isometry3, Vector3};

    let root = tempfile::tempdir().unwrap();
    let stand = around_the_desks()[0].world_from_camera;
    let poses = (0..90).map(|k| {
        let stamp = f64::from(k) / 30.0;
        let wave = |size: f64, period: f64| size * (std::f64::consts::TAU * stamp / period).sin();
        let turn = Vector3::new(wave(0.1, 1.3), wave(0.15, 0.9), 0.0);
        let turn = Isometry3::new(Vector3::zeros(), turn);
        Pose { stamp, world_from_camera: stand * turn }
    });
    let folder = film(root.path(), poses.collect());
    let list = std::fs::read_to_string(folder.join("depth.txt")).unwrap();
    let options = Options { init: Init::Orb, ..best() };
    for late_s in [0.0, 0.012] {
        let shifted = list.lines().map(|line| match line.split_once(' ') {
            Some((stamp, file)) if !line.starts_with('#') => {
                format!("{:.6} {file}\n", stamp.parse::<f64>().unwrap() + late_s)
            }
            _ => format!("{line}\n"),
        });
        std::fs::write(folder.join("depth.txt"), shifted.collect::<String>()).unwrap();
        let mapped = mapped(&open(&folder, &Assumed::default()).unwrap(), &options);
        let offset = mapped.clock_offset().unwrap();
        // Four standard errors: false alarm probability 6e-5.
        let off = (offset.seconds - late_s).abs() / offset.std_error_s;
        assert!(off < 4.0 && offset.std_error_s < 0.003, "{late_s}: {offset:?}");
        let told = mapped.remarks.iter().any(|r| r.contains("ms late beside the colour images"));
        assert_eq!(told, late_s > 0.0, "{:?}", mapped.remarks);
    }
}
