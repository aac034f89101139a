//! kinoise finds out how noisy one particular depth sensor is.
//!
//! The pipeline on one page: a [`Recording`] of a planar target is opened, every view becomes a
//! [`ViewMeasurement`] (plane, sigma), the sigmas become a [`SigmaTable`], and a fit of
//! sigma(z, theta) becomes a [`NoiseModel`].
//!
//! ```no_run
//! use kinoise::{CalibrateOptions, io};
//!
//! let recording = io::open("recording".as_ref(), &io::Assumed::default())?;
//! let options = CalibrateOptions { form: Some(kinoise::Form::Paper), ..Default::default() };
//! let views = kinoise::measure_recording(&recording, &options.measure, &|_, _| ())?;
//! let calibration = kinoise::model_of(&recording, &views, &options)?;
//! println!("sigma at 2 m: {:.1} mm", 1e3 * calibration.model.sigma.sigma(2.0, 0.0));
//! # Ok::<(), kinoise::Error>(())
//! ```
//!
//! Everything is SI (m, rad, s). Optical frame: x right, y down, z forward. Method: Yamaguchi,
//! Emaru, Kobayashi, Ravankar, "3D map-building from RGB-D data considering noise
//! characteristics of Kinect" (SII 2016).

// In layers: a module imports only from those above it (tests/structure.py checks it). The blank
// lines keep rustfmt from sorting them into one list.
pub mod error;

pub mod rng;
pub mod units;

pub mod solve;
pub mod stats;

pub mod camera;
pub mod frame;

pub mod view;

pub mod io;

pub mod trajectory;

pub mod evaluate;

pub mod sequence;

pub mod plane;

pub mod residual;

pub mod terms;

pub mod scene;

pub mod measure;

pub mod model;

pub mod calibrate;

pub mod effects;

pub mod diagnose;

pub mod correct;

pub mod simulate;

pub mod map;

pub mod compare;

pub mod capture;

pub mod report;

/// Called as the work goes on: steps done, steps in all.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

pub use calibrate::{
    CalibrateOptions, Calibration, Measurements, measure as measure_recording, model_of,
    model_of_table,
};
pub use camera::Camera;
pub use error::{Error, Result};
pub use frame::{DepthCode, Frame};
pub use measure::{SigmaKind, SigmaTable, ViewMeasurement};
pub use model::{Form, NoiseModel, SigmaFit, SigmaModel};
pub use plane::Plane;
pub use rng::Seed;
pub use view::{Recording, Sensor, View};
