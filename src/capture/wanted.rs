//! The views still wanted: the paper's grid, those a diagnosis advised, or any still pose.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::plane::Plane;

/// Where a target stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Depth of its plane on the optical axis, m.
    pub z_m: f64,
    /// Between the optical axis and the plane's normal, rad.
    pub theta_rad: f64,
    /// Image direction in which depth grows, rad; 0 along the columns, a quarter turn along the
    /// rows. Means nothing for a target that is seen from the front.
    pub azimuth_rad: f64,
}

impl Pose {
    /// Of a plane.
    pub fn of(plane: &Plane) -> Self {
        Pose { z_m: plane.depth(0.0, 0.0), theta_rad: plane.theta(), azimuth_rad: plane.azimuth() }
    }

    /// A folder's name: centimetres and degrees, so that names sort by distance.
    fn name(&self, with_azimuth: bool) -> String {
        let whole = |v: f64| v.round().max(0.0);
        let mut name =
            format!("z{:03}-t{:02}", whole(100.0 * self.z_m), whole(self.theta_rad.to_degrees()));
        if with_azimuth && self.theta_rad > DIRECTED_RAD {
            let turn = self.azimuth_rad.to_degrees().rem_euclid(360.0).round() % 360.0;
            name += &format!("-a{turn:03}");
        }
        name
    }

    /// From a name that [`Pose::name`] made.
    fn named(name: &str) -> Option<Self> {
        let mut parts = name.split('-');
        let mut number = |letter: char| parts.next()?.strip_prefix(letter)?.parse::<f64>().ok();
        let (z, t) = (number('z')?, number('t')?);
        let a = number('a').unwrap_or(0.0);
        Some(Pose { z_m: z / 100.0, theta_rad: t.to_radians(), azimuth_rad: a.to_radians() })
    }
}

/// Below this tilt a direction means nothing, rad.
const DIRECTED_RAD: f64 = 0.1;

/// How near a pose must be to count as the one wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// m.
    pub z_m: f64,
    /// rad.
    pub theta_rad: f64,
    /// rad; `None` when every direction will do.
    pub azimuth_rad: Option<f64>,
}

/// Four fifths of half the grid's pitch: every cell is hit by hand, and no pose belongs to two.
const GRID: Tolerance = Tolerance { z_m: 0.2, theta_rad: 0.07, azimuth_rad: None };

/// A view that shall be taken.
#[derive(Debug, Clone, PartialEq)]
pub struct WantedView {
    /// The view's folder.
    pub name: String,
    pub pose: Pose,
    pub tolerance: Tolerance,
    /// What it is good for, where somebody said so.
    pub why: Option<String>,
    pub state: ViewState,
}

/// What has become of a wanted view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewState {
    /// Not taken yet, or to be taken again.
    Open,
    /// On the disk.
    Taken,
    /// Given up by hand.
    Skipped,
}

impl WantedView {
    fn new(pose: Pose, tolerance: Tolerance, why: Option<String>) -> Self {
        let name = pose.name(tolerance.azimuth_rad.is_some());
        WantedView { name, pose, tolerance, why, state: ViewState::Open }
    }

    /// Is a target at `pose` where it is wanted?
    pub fn fits(&self, pose: &Pose) -> bool {
        let near = |a: f64, b: f64, within: f64| (a - b).abs() <= within;
        near(pose.z_m, self.pose.z_m, self.tolerance.z_m)
            && near(pose.theta_rad, self.pose.theta_rad, self.tolerance.theta_rad)
            && self.turn(pose).abs() <= self.tolerance.azimuth_rad.unwrap_or(f64::INFINITY)
    }

    /// How far the direction of the tilt is off, rad in (-pi, pi]; 0 where it does not matter.
    pub fn turn(&self, pose: &Pose) -> f64 {
        if self.tolerance.azimuth_rad.is_none() || self.pose.theta_rad < DIRECTED_RAD {
            return 0.0;
        }
        let (sin, cos) = (self.pose.azimuth_rad - pose.azimuth_rad).sin_cos();
        sin.atan2(cos)
    }

    /// How far from `pose`, in cells of the paper's grid.
    pub(super) fn away(&self, pose: &Pose) -> f64 {
        let z = (pose.z_m - self.pose.z_m) / 0.5;
        let theta = (pose.theta_rad - self.pose.theta_rad) / 10f64.to_radians();
        z.hypot(theta).hypot(self.turn(pose))
    }
}

/// The list.
#[derive(Debug, Clone, PartialEq)]
pub struct Wanted {
    pub views: Vec<WantedView>,
    /// Every new still pose is wanted too.
    pub any: bool,
}

impl Wanted {
    /// Every distance, m, at every tilt, rad, whatever its direction.
    pub fn grid(distances_m: &[f64], tilts_rad: &[f64]) -> Self {
        let view = |z_m: f64, theta_rad: f64| {
            let pose = Pose { z_m, theta_rad, azimuth_rad: 0.0 };
            WantedView::new(pose, GRID, None)
        };
        let views = distances_m.iter().flat_map(|&z| tilts_rad.iter().map(move |&t| view(z, t)));
        Wanted { views: views.collect(), any: false }
    }

    /// The paper's: 1 to 4 m by 0.5 m, 0 to 80 degrees by 10.
    pub fn paper() -> Self {
        let tilts: Vec<f64> = (0..9).map(|i| f64::from(10 * i).to_radians()).collect();
        let distances: Vec<f64> = (0..7).map(|i| 1.0 + 0.5 * f64::from(i)).collect();
        Wanted::grid(&distances, &tilts)
    }

    /// Whatever holds still and is not there yet.
    pub fn any() -> Self {
        Wanted { views: Vec::new(), any: true }
    }

    /// What a diagnosis would like to see next (`diagnosis.json`).
    ///
    /// # Errors
    /// When it is no diagnosis, or advises nothing.
    pub fn advised(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::read(path, e))?;
        let said: Advice = serde_json::from_str(&text).map_err(|e| Error::Json {
            path: path.into(),
            line: e.line(),
            what: e.to_string(),
            remedy: "give the diagnosis.json that kinoise diagnose wrote",
        })?;
        let mut views: Vec<WantedView> = Vec::new();
        for advice in said.findings.into_iter().filter_map(|f| f.next_view) {
            let Advised { z_m, theta_rad, azimuth_rad, why } = advice;
            let tolerance = Tolerance {
                z_m: 0.1 * z_m,
                theta_rad: 5f64.to_radians(),
                azimuth_rad: Some(20f64.to_radians()),
            };
            let view = WantedView::new(Pose { z_m, theta_rad, azimuth_rad }, tolerance, Some(why));
            if views.iter().all(|v| v.name != view.name) {
                views.push(view);
            }
        }
        if views.is_empty() {
            return Err(Error::Json {
                path: path.into(),
                line: 0,
                what: "the diagnosis advises no further view".into(),
                remedy: "leave --advise out to take the paper's grid",
            });
        }
        Ok(Wanted { views, any: false })
    }

    /// Mark what is on the disk already.
    pub fn mark_taken(&mut self, names: &[String]) {
        for name in names {
            match self.views.iter_mut().find(|v| v.name == *name) {
                Some(view) => view.state = ViewState::Taken,
                None if self.any => {
                    let Some(pose) = Pose::named(name) else { continue };
                    let mut view = WantedView::new(pose, ANY, None);
                    view.name.clone_from(name);
                    view.state = ViewState::Taken;
                    self.views.push(view);
                }
                None => {}
            }
        }
    }

    /// Want a view again that is among those `taken`.
    ///
    /// # Errors
    /// When there is no such view, or its name does not tell its pose.
    pub fn take_again(&mut self, name: &str, taken: &[String]) -> Result<()> {
        if !taken.iter().any(|t| t == name) {
            return Err(Error::Argument {
                what: format!("--retake {name}: there is no such view"),
                remedy: "give the name of a folder in the recording",
            });
        }
        if let Some(view) = self.views.iter_mut().find(|v| v.name == name) {
            view.state = ViewState::Open;
            return Ok(());
        }
        let pose = Pose::named(name).ok_or_else(|| Error::Argument {
            what: format!("--retake {name}: the name does not say where the target stood"),
            remedy: "remove the folder and take the view anew",
        })?;
        let tolerance = if name.contains("-a") { ANY } else { GRID };
        let view = WantedView { name: name.into(), ..WantedView::new(pose, tolerance, None) };
        self.views.push(view);
        Ok(())
    }

    /// Which open view a target at `pose` would make. In a list of any poses a new one is added.
    pub fn claim(&mut self, pose: &Pose) -> Option<usize> {
        let open = |v: &WantedView| v.state == ViewState::Open;
        let near = self.nearest(pose, |v| open(v) && v.fits(pose));
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

    /// The open view that takes least moving; the first one when nothing is seen.
    pub fn suggestion(&self, pose: Option<&Pose>) -> Option<usize> {
        let open = |v: &WantedView| v.state == ViewState::Open;
        match pose {
            Some(pose) => self.nearest(pose, open),
            None => self.views.iter().position(open),
        }
    }

    fn nearest(&self, pose: &Pose, of: impl Fn(&WantedView) -> bool) -> Option<usize> {
        let chosen = self.views.iter().enumerate().filter(|(_, v)| of(v));
        chosen.min_by(|(_, a), (_, b)| a.away(pose).total_cmp(&b.away(pose))).map(|(i, _)| i)
    }

    /// How many views are in this state.
    pub fn count(&self, state: ViewState) -> usize {
        self.views.iter().filter(|v| v.state == state).count()
    }

    /// Nothing is left to take.
    pub fn is_done(&self) -> bool {
        !self.any && self.count(ViewState::Open) == 0
    }
}

/// Two poses nearer than this are one view.
const ANY: Tolerance = Tolerance { z_m: 0.05, theta_rad: 0.05, azimuth_rad: Some(0.35) };

#[derive(Deserialize)]
struct Advice {
    findings: Vec<Finding>,
}

#[derive(Deserialize)]
struct Finding {
    next_view: Option<Advised>,
}

#[derive(Deserialize)]
struct Advised {
    z_m: f64,
    theta_rad: f64,
    azimuth_rad: f64,
    why: String,
}
