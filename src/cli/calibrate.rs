use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, ValueEnum};
use kinoise::calibrate::{Measurements, measure, model_of};
use kinoise::io::{OutputDir, open};
use kinoise::measure::{MeasureOptions, Planes, write_measurements};
use kinoise::stats;
use kinoise::units::shortest;
use kinoise::{CalibrateOptions, Calibration, Form, Recording, SigmaKind};

use super::common::{Bar, Global, Input, say, source_date};
use super::words;

#[derive(Debug, Args)]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, or a folder of 16-bit PNGs
    recording: PathBuf,
    /// Folder for model.json, measurements.csv, sigma.svg and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    fitting: Fitting,
    /// Which standard deviation the model describes
    #[arg(long, value_enum, default_value_t = Sigma::Spatial)]
    sigma: Sigma,
    /// One plane for the still view, or one for every frame of it
    #[arg(long, value_enum, default_value_t = PlanesArgument::View)]
    planes: PlanesArgument,
    /// The paper's RANSAC threshold in m [default: 3 robust standard deviations of the view]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    ransac_threshold: Option<f64>,
}

/// Options of the fit, also of `kinoise fit`.
#[derive(Debug, Args)]
pub struct Fitting {
    /// paper, nguyen, khoshelham, disparity; auto takes what predicts left-out distances best
    #[arg(long, default_value = "paper")]
    form: String,
    /// Published curves to draw beside the fit: eq1, nguyen, khoshelham
    #[arg(long, value_delimiter = ',', default_value = "eq1")]
    overlay: Vec<kinoise::report::Overlay>,
}

impl Fitting {
    pub fn form(&self) -> anyhow::Result<Option<Form>> {
        if self.form == "auto" {
            return Ok(None);
        }
        self.form.parse().map(Some).map_err(|e: String| anyhow::anyhow!("--form: {e}"))
    }

    pub fn overlays(&self) -> &[kinoise::report::Overlay] {
        &self.overlay
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Sigma {
    Spatial,
    Temporal,
    Total,
    Paper,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum PlanesArgument {
    View,
    Frame,
}

impl Arguments {
    fn options(&self, global: &Global) -> anyhow::Result<CalibrateOptions> {
        if let Some(t) = self.ransac_threshold
            && !(t > 0.0 && t.is_finite())
        {
            anyhow::bail!("--ransac-threshold {}: give a positive distance in m", shortest(t));
        }
        Ok(CalibrateOptions {
            measure: MeasureOptions {
                planes: match self.planes {
                    PlanesArgument::View => Planes::PerView,
                    PlanesArgument::Frame => Planes::PerFrame,
                },
                ransac_threshold_m: self.ransac_threshold,
                seed: global.seed(),
                ..MeasureOptions::default()
            },
            kind: match self.sigma {
                Sigma::Spatial => SigmaKind::Spatial,
                Sigma::Temporal => SigmaKind::Temporal,
                Sigma::Total => SigmaKind::Total,
                Sigma::Paper => SigmaKind::Paper,
            },
            form: self.fitting.form()?,
            created: source_date(),
        })
    }
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    let options = arguments.options(global)?;
    let recording = open(&arguments.recording, &arguments.input.assumed()?)?;
    let done = calibrate(&recording, &options, &arguments.output, arguments.fitting.overlays())?;
    global.print_json(&words::as_json(&done.calibration, Some(&done.measurements)))
}

/// A finished calibration with what it was made from.
pub struct Done {
    pub measurements: Measurements,
    pub calibration: Calibration,
}

/// Measure, fit, write every output, tell.
pub fn calibrate(
    recording: &Recording,
    options: &CalibrateOptions,
    output: &Path,
    overlays: &[kinoise::report::Overlay],
) -> anyhow::Result<Done> {
    let out = OutputDir::create(output)?;
    let bar = Bar::new("views");
    let measurements = measure(recording, &options.measure, &|done, all| bar.step(done, all))?;
    drop(bar);
    say(opening(recording, &measurements));
    out.write("measurements.csv", write_measurements(&measurements.views).as_bytes())?;
    let calibration = model_of(recording, &measurements, options).with_context(|| {
        // Without a model there is no list of warnings: this is the only place to say why.
        measurements.excluded.iter().for_each(|e| say(format!("note: {e}")));
        recording.remarks.iter().for_each(|r| say(format!("note: {r}")));
        let older = if out.path().join("model.json").exists() {
            " (the model.json there is from an earlier run)"
        } else {
            ""
        };
        format!(
            "the views were measured ({}) but no model was fitted{older}",
            out.path().join("measurements.csv").display()
        )
    })?;
    let page = kinoise::report::CalibrationPage {
        title: &format!("Noise of {}", recording.sensor.name),
        sensor: Some(&recording.sensor),
        measurements: Some(&measurements),
        calibration: &calibration,
        overlays,
    };
    write_outputs(&out, &page)?;
    say(words::summary(&calibration));
    say(words::warnings(&calibration));
    Ok(Done { measurements, calibration })
}

/// Model, figures and page.
pub fn write_outputs(
    out: &OutputDir,
    page: &kinoise::report::CalibrationPage<'_>,
) -> anyhow::Result<()> {
    let calibration = page.calibration;
    let figure =
        kinoise::report::figure2(&calibration.table, &calibration.model.sigma, page.overlays);
    let map = kinoise::report::sigma_map(&calibration.table, &calibration.model.sigma);
    out.write("sigma.svg", figure.svg()?.as_bytes())?;
    out.write("sigma.png", &figure.png()?)?;
    out.write("sigma_map.svg", map.svg()?.as_bytes())?;
    out.write("sigma_map.png", &map.png()?)?;
    out.write("report.html", kinoise::report::calibration_page(page)?.as_bytes())?;
    let model = out.path().join("model.json");
    calibration.model.write(&model)?;
    say(format!(
        "wrote {}, with sigma.svg, sigma_map.svg and report.html beside it\n",
        model.display()
    ));
    Ok(())
}

fn opening(recording: &Recording, m: &Measurements) -> String {
    let range = |f: &dyn Fn(&kinoise::ViewMeasurement) -> f64| stats::range(m.views.iter().map(f));
    let [z0, z1] = range(&|v| v.z_m);
    let [t0, t1] = range(&|v| v.theta_rad.to_degrees());
    let frames: usize = m.views.iter().map(|v| v.frames).sum();
    let [f0, f1] = range(&|v| v.frames as f64);
    let each = if f0 == f1 { format!("{f0} a view") } else { format!("{f0} to {f1} a view") };
    format!(
        "{}: {} of {} views measured, {frames} frames ({each}), z {z0:.2} to {z1:.2} m, tilt {t0:.1} to {t1:.1} degrees",
        recording.sensor.name,
        m.views.len(),
        m.views.len() + m.excluded.len(),
    )
}
