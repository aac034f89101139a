//! recording.json and view.json.

use kinoise::io::{Assumed, open, write_recording_file, write_view_notes};
use kinoise::measure::MeasureOptions;
use kinoise::scene::Target;
use kinoise::simulate::{Grid, Shoot, kinect_v1};
use kinoise::{Seed, SigmaModel, measure_recording};

use super::desk::{Desk, check, frame_png};

/// recording.json beside a view of 8 x 6 px.
pub fn recording(data: &[u8]) -> bool {
    thread_local! {
        static DESK: Desk = Desk::new(&[
            ("a/depth.txt", b"0 0.png\n0.5 1.png\n"),
            ("a/0.png", &frame_png()),
            ("a/1.png", &frame_png()),
        ]);
    }
    DESK.with(|desk| {
        desk.put("recording.json", data);
        let Ok(first) = open(desk.root(), &Assumed::default()) else { return false };
        check(&first);
        write_recording_file(desk.root(), &first.sensor).expect("written");
        let again = open(desk.root(), &Assumed::default()).expect("what was written is read");
        assert_eq!(again.sensor, first.sensor);
        assert_eq!(again.views, first.views);
        true
    })
}

/// view.json of one view of a wall, which is measured.
pub fn view(data: &[u8]) -> bool {
    thread_local! {
        static DESK: Desk = wall();
    }
    DESK.with(|desk| {
        desk.put("0000/view.json", data);
        let Ok(first) = open(desk.root(), &Assumed::default()) else { return false };
        check(&first);
        let notes = &first.views[0].notes;
        let file = desk.root().join("0000/view.json");
        std::fs::remove_file(&file).expect("removed");
        write_view_notes(&desk.root().join("0000"), notes).expect("written");
        let again = open(desk.root(), &Assumed::default()).expect("what was written is read");
        assert_eq!(again.views[0].notes, *notes);
        let options = MeasureOptions { ransac_iterations: 20, ..MeasureOptions::default() };
        let Ok(measured) = measure_recording(&first, &options, &|_, _| ()) else { return true };
        for m in &measured.views {
            let numbers = [m.z_m, m.theta_rad, m.azimuth_rad, m.axis_distance_m];
            assert!(numbers.iter().all(|v| v.is_finite()) && m.z_m > 0.0, "{m:?}");
            let sigmas = m.cells.iter().flat_map(|c| [c.z_m, c.spread.spatial_m, c.std_error_m]);
            assert!(sigmas.into_iter().all(|v| v.is_finite()), "{m:?}");
            let budget = m.distance_budget.as_ref();
            assert!(budget.is_none_or(|b| b.combined_m.is_finite() && b.expanded_m.is_finite()));
        }
        true
    })
}

/// One view of 40 x 30 px.
fn wall() -> Desk {
    let desk = Desk::new(&[]);
    let poses = Grid { distances_m: vec![1.5], tilts_rad: vec![0.3] }.views();
    let shoot = Shoot::plain(kinect_v1(16), Target::Wall, &poses, 2, SigmaModel::paper(), Seed(1));
    shoot.write(desk.root(), &|_, _| ()).expect("a recording");
    desk
}
