use super::*;

fn behind(distortion: [f64; 5]) -> Camera {
    Camera { distortion: Some(distortion), ..Camera::centred(640, 480, 580.0) }
}

#[test]
fn a_usable_lens_gives_back_every_pixel() {
    for k in [[0.0; 5], [-0.26, 0.1, -7.6e-4, 5.0e-3, 0.02], [-0.35, 0.15, 0.0, 0.0, 0.0]] {
        let camera = behind(k);
        assert_eq!(camera.fault(), None, "{k:?}");
        for (u, v) in (0..640).step_by(71).zip((0..480).step_by(53)) {
            let (x, y) = camera.ray(u as f64, v as f64);
            let (pu, pv) = camera.project(x, y);
            assert!((pu - u as f64).hypot(pv - v as f64) < 1e-8, "{k:?}: {pu} {pv}");
        }
        // Rays whose search starts from their neighbours are the same.
        let rays = camera.rays();
        for i in (0..rays.x.len()).step_by(97) {
            let (x, y) = camera.ray((i % 640) as f64, (i / 640) as f64);
            let off = (f64::from(rays.x[i]) - x).hypot(f64::from(rays.y[i]) - y);
            assert!(off < 6e-8, "{k:?}: {off}");
        }
    }
}

/// Places between the pixels that Newton's method does not find directly from the distorted place (found by
/// chance, by tests/product/degenerate.rs), and a lens for which it does not find some at all.
#[test]
fn a_lens_that_bends_much_gives_back_what_lies_between_the_pixels() {
    let k = [0.304682, -0.2622173, 0.0999, -0.0999, 0.1737139];
    let camera = Camera { distortion: Some(k), ..Camera::centred(35, 3, 34.383658) };
    assert_eq!(camera.fault(), None);
    for n in 0..=3400 {
        let (u, v) = (f64::from(n) / 100.0, 2.0 * f64::from(n % 100) / 100.0);
        let (x, y) = camera.ray(u, v);
        let (pu, pv) = camera.project(x, y);
        assert!((pu - u).hypot(pv - v) < 1e-6, "{u} {v}: {pu} {pv}");
    }
    let fault = behind([0.3, -0.26, 0.24, -0.22, 0.17]).fault().expect("a fault");
    assert!(fault.to_string().contains("p1 and p2 lie within -0.1 and 0.1"), "{fault}");
}

/// The slope 1 - 7.5 s + 12.5 s^2 is negative between s = 0.2 and 0.4, inside the image.
#[test]
fn a_lens_that_folds_is_named() {
    let fault = behind([-2.5, 2.5, 0.0, 0.0, 0.0]).fault().expect("a fault");
    assert!(fault.to_string().contains("[-2.5, 2.5, 0, 0, 0]"), "{fault}");
    assert!(folds(&[-2.5, 2.5, 0.0, 0.0, 0.0], 0.5), "k3 = 0");
    assert!(folds(&[-1.0, 0.0, 0.0, 0.0, 0.0], 0.5), "k2 = k3 = 0");
    assert!(folds(&[0.0, 0.0, 0.0, 0.0, -1.0], 1.0), "k1 = k2 = 0");
    // Its radius r (1 - 0.8 r^2) reaches 0.43 at most, the corner's is 0.69.
    let barrel = behind([-0.8, 0.0, 0.0, 0.0, 0.0]);
    assert!(barrel.fault().is_some_and(|f| f.contains("no ray for pixel (0, 0)")));
    assert!(barrel.ray(0.0, 0.0).0.is_nan() && barrel.ray(320.0, 240.0).0.is_finite());
    assert!(!folds(&[-2.5, 2.5, 0.0, 0.0, 0.0], 0.1) && !folds(&[0.0; 5], 1.0));
}
