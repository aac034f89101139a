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

pub mod calibrate;
pub mod camera;
pub mod capture;
pub mod compare;
pub mod correct;
pub mod diagnose;
pub mod effects;
pub mod error;
pub mod evaluate;
pub mod frame;
pub mod io;
pub mod map;
pub mod measure;
pub mod model;
pub mod plane;
pub mod report;
pub mod residual;
pub mod rng;
pub mod scene;
pub mod sequence;
pub mod simulate;
pub mod solve;
pub mod stats;
pub mod terms;
pub mod trajectory;
pub mod units;
pub mod view;

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
