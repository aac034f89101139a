//! Poses as text.

use std::fmt::Write;

use super::Pose;

/// A trajectory file in the TUM format.
pub fn tum_text(poses: &[Pose]) -> String {
    let mut text = String::from("# timestamp tx ty tz qx qy qz qw\n");
    for Pose { stamp, world_from_camera } in poses {
        let (t, q) = (world_from_camera.translation, world_from_camera.rotation);
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{stamp:.6} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9}",
            t.x, t.y, t.z, q.i, q.j, q.k, q.w
        );
    }
    text
}
