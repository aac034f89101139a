//! How noisy one particular depth sensor is, why, and what to do with that knowledge.
//!
//! Point a depth camera at a flat board and every pixel should lie on one plane. kinoise measures
//! by how much it does not, writes that down as a noise model sigma(z, theta), looks for the physics
//! the model leaves out, and uses the result to correct depth and to weigh points in a map.
//!
//! # The pipeline on one page
//!
//! ```text
//! folder -io::open-> Recording -measure_recording-> Measurements -model_of-> NoiseModel -> model.json
//!                        |                      (a plane and its                |
//!                        |                     sigmas for each view)            |
//!                        +-----------------> diagnose <-------------------------+
//!                        |                      |                               |
//!                        |                      +-> Diagnosis, NoiseModel with the effects found
//!                        |                                                      |
//!                        +-> correct: the recording without the model's biases
//!                                                                               |
//! folder -sequence::open-> Sequence ------------------> map::map <--------------+
//!                                                          +-> trajectory and points
//! ```
//!
//! 1. [`io::open`] reads a [`Recording`]: a sensor and the still views it took of a flat target.
//! 2. [`measure_recording`] finds the target, fits one plane to it ([`plane`]; in inverse depth, where
//!    a plane is affine in the image, with redescending weights) and measures how the depth scatters
//!    about it ([`mod@measure`]): over the pixels of a frame, over time, and across the plane. Tails
//!    are cut at 3.5 sigma and the variance corrected for it. Standard errors count effective
//!    samples, from the measured correlation of neighbours and of frames. The paper's own method,
//!    RANSAC and total least squares, is carried along.
//! 3. [`model_of`] fits sigma(z, theta) to these numbers (variable projection and a trust region,
//!    relative residuals) and gives a [`NoiseModel`] ([`model`]) with its covariance, what the views
//!    could not determine, and how well each form predicts distances left out.
//! 4. [`diagnose::diagnose`] compares the recording with the model, locates what does not agree and
//!    names its cause from the [catalogue of effects](docs::catalogue). The effects found extend the
//!    model, with the covariance of the fitted shapes. A difference within the covariance of a model
//!    learnt from other views is not a finding.
//! 5. Everything else runs on the model: [`simulate`] draws recordings from it, [`correct`]
//!    takes its biases out of depth images and can say, pixel by pixel, how sure the result is, and
//!    [`mod@map`] weighs points by its sigma. [`fleet`] puts the models of several units side by side.
//!
//! Simulated data is read like real data: [`simulate`] writes a folder, [`io::open`] reads it. The
//! examples below use that to run anywhere.
//!
//! # Calibrate
//!
//! ```
//! use kinoise::scene::Target;
//! use kinoise::simulate::{Grid, Shoot, kinect_v1};
//! use kinoise::{CalibrateOptions, Form, Seed, SigmaModel, io, measure_recording, model_of};
//!
//! // Views of a wall at five distances and three tilts, with the noise of the paper's Eq. 1.
//! let folder = tempfile::tempdir()?;
//! let distances_m = vec![1.0, 1.5, 2.0, 3.0, 4.0];
//! let poses = Grid { distances_m, tilts_rad: vec![0.0, 0.3, 0.6] }.views();
//! let truth = SigmaModel::paper();
//! Shoot::plain(kinect_v1(4), Target::Wall, &poses, 2, truth.clone(), Seed(1))
//!     .write(folder.path(), &|_, _| ())?;
//!
//! let recording = io::open(folder.path(), &io::Assumed::default())?;
//! let options = CalibrateOptions { form: Some(Form::Paper), ..Default::default() };
//! let measured = measure_recording(&recording, &options.measure, &|_, _| ())?;
//! let model = model_of(&recording, &measured, &options)?.model;
//!
//! let (fitted, expected) = (model.sigma.sigma(2.0, 0.0), truth.sigma(2.0, 0.0));
//! assert!((fitted / expected - 1.0).abs() < 0.05, "{fitted} m, not {expected} m");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Diagnose
//!
//! ```
//! use kinoise::diagnose::{DiagnoseOptions, diagnose};
//! use kinoise::effects::Active;
//! use kinoise::scene::Target;
//! use kinoise::simulate::{Grid, Physics, Shoot, kinect_v1};
//! use kinoise::{NoiseModel, Seed, SigmaModel, io};
//!
//! // The same wall, seen by a sensor whose disparity is bent into a bowl.
//! let folder = tempfile::tempdir()?;
//! let distances_m = vec![1.0, 1.5, 2.0, 3.0, 4.0];
//! let poses = Grid { distances_m, tilts_rad: vec![0.0, 0.3, 0.6] }.views();
//! let sigma = SigmaModel::paper();
//! let mut shoot = Shoot::plain(kinect_v1(4), Target::Wall, &poses, 2, sigma.clone(), Seed(1));
//! let bowl = Active::parse("radial-disparity-bias:k_px=0.1")?;
//! shoot.physics = Physics::Formula { sigma, effects: vec![bowl] };
//! shoot.write(folder.path(), &|_, _| ())?;
//!
//! // What does Eq. 1 leave out of it?
//! let recording = io::open(folder.path(), &io::Assumed::default())?;
//! let found = diagnose(&recording, &NoiseModel::paper(), &DiagnoseOptions::default(), &|_, _| ())?;
//!
//! let first = &found.diagnosis.findings[0];
//! assert_eq!(first.effect, Some("radial-disparity-bias"));
//! let k_px = first.parameters["k_px"]["value"].as_f64().unwrap_or(f64::NAN);
//! assert!((k_px - 0.1).abs() < 0.02, "{k_px} px");
//! // The extended model holds it, ready for `correct` and `map`.
//! assert_eq!(found.model.effects[0].id, "radial-disparity-bias");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Map
//!
//! ```
//! use kinoise::evaluate::{Delta, evaluate};
//! use kinoise::map::{Options, map};
//! use kinoise::simulate::Physics;
//! use kinoise::simulate::room::{Film, Room, around_the_desks};
//! use kinoise::{NoiseModel, Seed, SigmaModel, io, sequence};
//!
//! // Half a second of an office, filmed by a small Kinect.
//! let folder = tempfile::tempdir()?;
//! let film = Film {
//!     sensor: Film::kinect(4),
//!     room: Room::office(Seed(1)),
//!     poses: around_the_desks().into_iter().take(15).collect(),
//!     physics: Physics::Formula { sigma: SigmaModel::paper(), effects: Vec::new() },
//!     seed: Seed(1),
//! };
//! film.write(folder.path(), &|_, _| ())?;
//!
//! let sequence = sequence::open(folder.path(), &io::Assumed::default())?;
//! let options = Options { block_px: 2, ..Options::best() };
//! let mapped = map(&sequence, &NoiseModel::paper(), &options, &|_, _| ())?;
//!
//! assert_eq!(mapped.lost(), 0);
//! let errors = evaluate(&sequence.truth, &mapped.trajectory(), Delta::Frames(1))?;
//! assert!(errors.ate.error.rmse < 0.005, "{} m", errors.ate.error.rmse);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Conventions
//!
//! Everything is SI (m, rad, s); pixels and disparities are in px, and a name ends in its unit.
//! Optical frame: x right, y down, z forward. Theta is the angle between the optical axis and the
//! plane's normal; azimuth is the direction in the image in which depth grows, 0 along the columns.
//! Errors ([`Error`]) say what went wrong, where, and what to do. Randomness is an argument: the same
//! [`Seed`] gives the same bytes, whatever the number of threads.
//!
//! # Where to read on
//!
//! - [`docs::catalogue`]: the physical effects, what each looks like and what it is confused with, and
//!   how to add one: a file in `src/effects` and a word in its list
//! - [`docs::layouts`]: every file that goes in or comes out
//! - [`docs::capture`]: how to take views with a Kinect
//! - [`docs::identifiability`]: what views of planes can show, and what they cannot
//! - [`docs::engine`]: how the diagnosis works, and where in the code
//! - [`report`]: the pages; their text on an effect is on its card in `src/effects`, and the other
//!   sentences of a diagnosis are in `story.rs` and `sentences.rs` of `src/report/diagnosis_page`
//!
//! "The paper" in these pages, the source of the calibration and of the paper's mapper: Yamaguchi, Emaru,
//! Kobayashi, Ravankar, "3D map-building from RGB-D data considering noise characteristics of Kinect"
//! (SII 2016).

#![deny(unsafe_code)]

// In layers: a module imports only from those above it (tests/structure.py checks it). The blank
// lines keep rustfmt from sorting them into one list.
pub mod docs;

pub mod error;

mod read;

pub mod progress;

pub mod rng;
pub mod units;

pub mod solve;
pub mod stats;

pub mod camera;
pub mod frame;
pub mod sensors;

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

pub mod metrics;

pub mod effects;

pub mod fleet;

pub mod diagnose;

pub mod schema;

pub mod correct;

pub mod export;

pub mod simulate;

pub mod map;

pub mod compare;

pub mod capture;

pub mod report;

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
pub use progress::{Progress, Watch};
pub use rng::Seed;
pub use view::{Recording, Sensor, View};
