//! The views still wanted: those of a grid or of a list, or any still pose.

use crate::error::{Error, Result};
use crate::plane::Plane;

/// Pose of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Depth of its plane on the optical axis, m.
    pub z_m: f64,
    /// Angle between the optical axis and the plane's normal, rad.
    pub theta_rad: f64,
    /// Image direction in which depth increases, rad; 0 to the right, pi/2 downwards.
    /// Undefined for a fronto-parallel target.
    pub azimuth_rad: f64,
}

impl Pose {
    /// Pose of a plane.
    pub fn of(plane: &Plane) -> Self {
        Pose { z_m: plane.depth(0.0, 0.0), theta_rad: plane.theta(), azimuth_rad: plane.azimuth() }
    }

    /// Folder name in centimetres and degrees, so that names sort by distance.
    fn name(&self, with_azimuth: bool) -> String {
        let whole = |v: f64| v.round().max(0.0);
        let [cm, degrees] = [100.0 * self.z_m, self.theta_rad.to_degrees()].map(whole);
        let mut name = format!("z{cm:03}-t{degrees:02}");
        if with_azimuth && self.theta_rad > MIN_DIRECTED_RAD {
            let turn = self.azimuth_rad.to_degrees().rem_euclid(360.0).round() % 360.0;
            name += &format!("-a{turn:03}");
        }
        name
    }
}

/// Tilt below which the direction is undefined, rad.
const MIN_DIRECTED_RAD: f64 = 0.1;

/// How close a pose must be to the wanted one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    pub z_m: f64,
    pub theta_rad: f64,
    /// rad; `None` if any direction is accepted.
    pub azimuth_rad: Option<f64>,
}

/// Four fifths of half the paper's grid spacing: easy to reach by hand, and no pose belongs to two cells.
const GRID: Tolerance = Tolerance { z_m: 0.2, theta_rad: 0.07, azimuth_rad: None };
/// For any pose: two poses closer than this are one view.
const ANY: Tolerance = Tolerance { z_m: 0.05, theta_rad: 0.05, azimuth_rad: Some(0.35) };

/// Sorted values without duplicates (values that a name cannot tell apart count once), and the tolerance: 0.4
/// of the finest pitch, but at most `max`.
fn pitches(values: &[f64], unit: f64, max: f64) -> (Vec<f64>, f64) {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values.dedup_by_key(|v| (*v / unit).round() as i64);
    let within = values.windows(2).map(|w| 0.4 * (w[1] - w[0])).fold(max, f64::min);
    (values, within)
}

/// A view to be taken.
#[derive(Debug, Clone, PartialEq)]
pub struct WantedView {
    /// Name of the view's folder.
    pub name: String,
    pub pose: Pose,
    pub tolerance: Tolerance,
    /// Purpose of the view, if a diagnosis asked for it.
    pub why: Option<String>,
    pub state: ViewState,
}

/// State of a wanted view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewState {
    /// Not taken yet, or to be taken again.
    Open,
    /// On the disk.
    Taken,
    /// Given up by the user.
    Skipped,
}

impl WantedView {
    pub(super) fn new(pose: Pose, tolerance: Tolerance, why: Option<String>) -> Self {
        let name = pose.name(tolerance.azimuth_rad.is_some());
        WantedView { name, pose, tolerance, why, state: ViewState::Open }
    }

    /// Parses a name made by [`Pose::name`].
    fn named(name: &str, tolerance: Tolerance) -> Option<Self> {
        let mut parts = name.split('-');
        let mut number = |letter: char| parts.next()?.strip_prefix(letter)?.parse::<f64>().ok();
        let (z_m, theta_rad) = (number('z')? / 100.0, number('t')?.to_radians());
        let azimuth_rad = number('a').unwrap_or(0.0).to_radians();
        let pose = Pose { z_m, theta_rad, azimuth_rad };
        Some(WantedView { name: name.into(), ..WantedView::new(pose, tolerance, None) })
    }

    pub fn is_open(&self) -> bool {
        self.state == ViewState::Open
    }

    /// Whether a target at `pose` is within the tolerance.
    pub fn fits(&self, pose: &Pose) -> bool {
        let near = |a: f64, b: f64, within: f64| (a - b).abs() <= within;
        near(pose.z_m, self.pose.z_m, self.tolerance.z_m)
            && near(pose.theta_rad, self.pose.theta_rad, self.tolerance.theta_rad)
            && self.turn(pose).abs() <= self.tolerance.azimuth_rad.unwrap_or(f64::INFINITY)
    }

    /// Whether the direction of the tilt matters.
    pub fn is_directed(&self) -> bool {
        self.tolerance.azimuth_rad.is_some() && self.pose.theta_rad > MIN_DIRECTED_RAD
    }

    /// Error of the tilt's direction, rad in (-pi, pi]; 0 if the direction does not matter.
    pub fn turn(&self, pose: &Pose) -> f64 {
        if !self.is_directed() {
            return 0.0;
        }
        let (sin, cos) = (self.pose.azimuth_rad - pose.azimuth_rad).sin_cos();
        sin.atan2(cos)
    }

    /// Distance from `pose`, in cells of the paper's grid.
    pub(super) fn distance(&self, pose: &Pose) -> f64 {
        let z = (pose.z_m - self.pose.z_m) / 0.5;
        let theta = (pose.theta_rad - self.pose.theta_rad) / 10f64.to_radians();
        z.hypot(theta).hypot(self.turn(pose))
    }
}

/// Distances of the paper's grid, m.
pub const PAPER_DISTANCES_M: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0];
/// Tilts of the paper's grid, degrees.
pub const PAPER_TILTS_DEG: [f64; 9] = [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0];

/// The list of wanted views.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    pub views: Vec<WantedView>,
    /// Whether every new still pose is wanted too.
    pub any: bool,
}

impl Wanted {
    /// Grid of every distance, m, at every tilt, rad, in any direction. Values that round to the same
    /// centimetre or degree count once.
    pub fn grid(distances_m: &[f64], tilts_rad: &[f64]) -> Self {
        let (distances, z_m) = pitches(distances_m, 0.01, GRID.z_m);
        let (tilts, theta_rad) = pitches(tilts_rad, 1f64.to_radians(), GRID.theta_rad);
        let tolerance = Tolerance { z_m, theta_rad, azimuth_rad: None };
        let view = |z_m: f64, theta_rad: f64| {
            WantedView::new(Pose { z_m, theta_rad, azimuth_rad: 0.0 }, tolerance, None)
        };
        let views = distances.iter().flat_map(|&z| tilts.iter().map(move |&t| view(z, t)));
        Wanted { views: views.collect(), any: false }
    }

    /// Any still pose that has not been taken yet.
    pub fn any() -> Self {
        Wanted { views: Vec::new(), any: true }
    }

    /// Marks the views that are already on the disk as taken.
    pub fn mark_taken(&mut self, names: &[String]) {
        for name in names {
            if let Some(view) = self.views.iter_mut().find(|v| v.name == *name) {
                view.state = ViewState::Taken;
            } else if self.any {
                let taken = |view| WantedView { state: ViewState::Taken, ..view };
                self.views.extend(WantedView::named(name, ANY).map(taken));
            }
        }
    }

    /// Reopens a view among those `taken`, to take it again.
    /// Fails if there is no such view, or its name does not tell its pose.
    pub fn take_again(&mut self, name: &str, taken: &[String]) -> Result<()> {
        let refuse = |why: &str, remedy: &'static str| Error::Argument {
            what: format!("--retake {name}: {why}"),
            remedy,
        };
        if !taken.iter().any(|t| t == name) {
            let remedy = "give the name of a folder in the recording";
            return Err(refuse("there is no such view", remedy));
        }
        if let Some(view) = self.views.iter_mut().find(|v| v.name == name) {
            view.state = ViewState::Open;
            return Ok(());
        }
        let tolerance = if name.contains("-a") { ANY } else { GRID };
        let unclear = "the name does not say where the target stood";
        let remedy = "remove the folder and take the view anew";
        let view = WantedView::named(name, tolerance).ok_or_else(|| refuse(unclear, remedy))?;
        self.views.push(view);
        Ok(())
    }

    /// Index of the open view that a target at `pose` would make. If any pose is wanted, a new one is added.
    pub fn claim(&mut self, pose: &Pose) -> Option<usize> {
        let near = self.nearest(pose, |v| v.is_open() && v.fits(pose));
        if near.is_some() || !self.any || self.views.iter().any(|v| v.fits(pose)) {
            return near;
        }
        let view = WantedView::new(*pose, ANY, None);
        if self.views.iter().any(|v| v.name == view.name) {
            return None;
        }
        self.views.push(view);
        Some(self.views.len() - 1)
    }

    /// The open view that needs the least movement; the first one if no target is seen.
    pub fn suggestion(&self, pose: Option<&Pose>) -> Option<usize> {
        match pose {
            Some(pose) => self.nearest(pose, WantedView::is_open),
            None => self.views.iter().position(WantedView::is_open),
        }
    }

    fn nearest(&self, pose: &Pose, of: impl Fn(&WantedView) -> bool) -> Option<usize> {
        let distance = |i: &usize| self.views[*i].distance(pose);
        let chosen = (0..self.views.len()).filter(|i| of(&self.views[*i]));
        chosen.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// How many views are in this state.
    pub fn count(&self, state: ViewState) -> usize {
        self.views.iter().filter(|v| v.state == state).count()
    }

    /// "3 of 63", or "3" where any pose will do.
    pub fn progress(&self) -> String {
        let of = if self.any { String::new() } else { format!(" of {}", self.views.len()) };
        format!("{}{of}", self.count(ViewState::Taken))
    }

    /// Whether nothing is left to take.
    pub fn is_done(&self) -> bool {
        !self.any && self.count(ViewState::Open) == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// However fine the grid is, no pose belongs to two of its views.
    #[test]
    fn a_fine_grid_has_narrow_cells_and_each_name_once() {
        let wanted = Wanted::grid(&[1.1, 1.0, 1.001, 1.2], &[0.0, 0.0, 0.05]);
        let names: Vec<&str> = wanted.views.iter().map(|v| v.name.as_str()).collect();
        assert_eq!(names, ["z100-t00", "z100-t03", "z110-t00", "z110-t03", "z120-t00", "z120-t03"]);
        for k in 0..=300 {
            let z_m = 0.95 + 0.001 * f64::from(k);
            let pose = Pose { z_m, theta_rad: 0.024, azimuth_rad: 0.0 };
            assert!(wanted.views.iter().filter(|v| v.fits(&pose)).count() <= 1, "{pose:?}");
        }
        let tilts = PAPER_TILTS_DEG.map(f64::to_radians);
        let paper = Wanted::grid(&PAPER_DISTANCES_M, &tilts);
        let Tolerance { z_m, theta_rad, .. } = paper.views[0].tolerance;
        assert!(z_m == GRID.z_m && (theta_rad - GRID.theta_rad).abs() < 1e-3, "the paper's stay");
    }
}
