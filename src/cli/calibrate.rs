use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use kinoise::calibrate::{Measurements, measure, model_of};
use kinoise::io::{OutputDir, open};
use kinoise::measure::{MeasureOptions, Planes, read_table, write_measurements};
use kinoise::report::{CalibrationPage, Overlay, calibration_page, figure2, sigma_map};
use kinoise::units::shortest;
use kinoise::{CalibrateOptions, Calibration, Form, Recording, SigmaKind, model_of_table, stats};

use super::calibrate_summary::{as_json, summary};
use super::common::{Global, Input, notes, one_of, say, source_date, with_bar};
use super::origin::origin;

#[derive(Debug, Args)]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, a folder of 16-bit PNGs, or a table
    /// z_m,theta_rad,sigma_m[,n] (.csv)
    recording: PathBuf,
    /// Folder for model.json, measurements.csv, sigma.svg and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    fitting: Fitting,
    /// Which standard deviation the model describes
    #[arg(long, default_value = "spatial", value_parser = one_of([
        ("spatial", "", SigmaKind::Spatial),
        ("temporal", "", SigmaKind::Temporal),
        ("total", "", SigmaKind::Total),
        ("paper", "", SigmaKind::Paper),
    ]))]
    sigma: SigmaKind,
    /// One plane for the still view, or one for every frame of it
    #[arg(long, default_value = "view", value_parser = one_of([
        ("view", "", Planes::PerView),
        ("frame", "", Planes::PerFrame),
    ]))]
    planes: Planes,
    /// The paper's RANSAC threshold in m [default: 3 robust standard deviations of the view]
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    ransac_threshold: Option<f64>,
}

/// `kinoise fit`: what `kinoise calibrate` does with a table.
#[derive(Debug, Args)]
pub struct FitArguments {
    /// CSV with the columns z_m,theta_rad,sigma_m and optionally n (SI units)
    table: PathBuf,
    /// Folder for model.json, sigma.svg and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    fitting: Fitting,
}

/// Options of the fit.
#[derive(Debug, Args)]
struct Fitting {
    /// paper, nguyen, khoshelham, disparity; auto takes what predicts left-out distances best
    #[arg(long, default_value = "paper")]
    form: String,
    /// Published curves to draw beside the fit: eq1, nguyen, khoshelham
    #[arg(long, value_delimiter = ',', default_value = "eq1")]
    overlay: Vec<Overlay>,
}

impl Fitting {
    fn form(&self) -> anyhow::Result<Option<Form>> {
        if self.form == "auto" {
            return Ok(None);
        }
        self.form.parse().map(Some).map_err(|e: String| anyhow::anyhow!("--form: {e}"))
    }
}

impl Arguments {
    fn options(&self, global: &Global) -> anyhow::Result<CalibrateOptions> {
        if let Some(t) = self.ransac_threshold
            && !(t > 0.0 && t.is_finite())
        {
            bail!("--ransac-threshold {}: give a positive distance in m", shortest(t));
        }
        let measure = MeasureOptions {
            planes: self.planes,
            ransac_threshold_m: self.ransac_threshold,
            seed: global.seed(),
            ..MeasureOptions::default()
        };
        let (form, created) = (self.fitting.form()?, source_date());
        Ok(CalibrateOptions { measure, kind: self.sigma, form, created })
    }

    /// A file whose name ends in .csv.
    fn is_table(&self) -> bool {
        let csv = self.recording.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
        csv && self.recording.is_file()
    }

    /// A table has no frames to measure.
    fn refuse_measuring(&self) -> anyhow::Result<()> {
        let options = [
            ("--sigma", self.sigma != SigmaKind::Spatial),
            ("--planes", self.planes != Planes::PerView),
            ("--ransac-threshold", self.ransac_threshold.is_some()),
            ("--intrinsics and the like", self.input != Input::default()),
        ];
        match options.iter().find(|(_, given)| *given) {
            Some((name, _)) => bail!("{name}: a table has no frames to measure; leave it out"),
            None => Ok(()),
        }
    }
}

pub fn run(arguments: &Arguments, global: &Global) -> anyhow::Result<()> {
    if arguments.is_table() {
        arguments.refuse_measuring()?;
        return table(&arguments.recording, &arguments.output, &arguments.fitting, global);
    }
    let options = arguments.options(global)?;
    let recording = open(&arguments.recording, &arguments.input.assumed()?)?;
    let overlays = &arguments.fitting.overlay;
    let (measured, calibration) = calibrate(&recording, &options, &arguments.output, overlays)?;
    global.print_json(&as_json(&calibration, Some(&measured)))
}

pub fn fit(arguments: &FitArguments, global: &Global) -> anyhow::Result<()> {
    table(&arguments.table, &arguments.output, &arguments.fitting, global)
}

/// Fit to a table alone.
fn table(file: &Path, output: &Path, fitting: &Fitting, global: &Global) -> anyhow::Result<()> {
    let form = fitting.form()?;
    let options = CalibrateOptions { form, created: source_date(), ..Default::default() };
    let calibration = model_of_table(&read_table(file)?, file, &options)
        .with_context(|| file.display().to_string())?;
    let page = CalibrationPage {
        title: &format!("Noise model of {}", file.display()),
        sensor: None,
        measurements: None,
        calibration: &calibration,
        overlays: &fitting.overlay,
        origin: &origin(file, output, global.seed),
    };
    write_outputs(&OutputDir::create(output)?, &page)?;
    global.print_json(&as_json(&calibration, None))
}

/// Measure, fit, write every output, report.
pub fn calibrate(
    recording: &Recording,
    options: &CalibrateOptions,
    output: &Path,
    overlays: &[Overlay],
) -> anyhow::Result<(Measurements, Calibration)> {
    let out = OutputDir::create(output)?;
    let measurements = with_bar("views", |step| measure(recording, &options.measure, step))?;
    say(measured(recording, &measurements));
    out.write("measurements.csv", write_measurements(&measurements.views).as_bytes())?;
    let calibration = model_of(recording, &measurements, options).with_context(|| {
        // Without a model there is no list of warnings: this is the only place to say why.
        notes(&measurements.excluded);
        notes(&recording.remarks);
        let older = match out.path().join("model.json").exists() {
            true => " (the model.json there is from an earlier run)",
            false => "",
        };
        format!(
            "the views were measured ({}) but no model was fitted{older}",
            out.path().join("measurements.csv").display()
        )
    })?;
    let page = CalibrationPage {
        title: &format!("Noise of {}", recording.sensor.name),
        sensor: Some(&recording.sensor),
        measurements: Some(&measurements),
        calibration: &calibration,
        overlays,
        origin: &origin(&recording.root, output, options.measure.seed.0),
    };
    write_outputs(&out, &page)?;
    Ok((measurements, calibration))
}

/// Model, figures and page; a summary for people.
fn write_outputs(out: &OutputDir, page: &CalibrationPage<'_>) -> anyhow::Result<()> {
    let calibration = page.calibration;
    let (table, sigma) = (&calibration.table, &calibration.model.sigma);
    let names = page.names();
    let charts = [
        ("sigma", figure2(table, sigma, page.overlays, &names)),
        ("sigma_map", sigma_map(table, sigma, &names)),
    ];
    for (name, chart) in charts {
        out.write(&format!("{name}.svg"), chart.svg()?.as_bytes())?;
        out.write(&format!("{name}.png"), &chart.png()?)?;
    }
    out.write("report.html", calibration_page(page)?.as_bytes())?;
    let model = out.path().join("model.json");
    calibration.model.write(&model)?;
    let beside = "with sigma.svg, sigma_map.svg and report.html beside it";
    say(format!("wrote {}, {beside}\n", model.display()));
    say(summary(calibration));
    notes(&calibration.warnings);
    Ok(())
}

fn measured(recording: &Recording, m: &Measurements) -> String {
    let range = |f: &dyn Fn(&kinoise::ViewMeasurement) -> f64| stats::range(m.views.iter().map(f));
    let [z0, z1] = range(&|v| v.z_m);
    let [t0, t1] = range(&|v| v.theta_rad.to_degrees());
    let frames: usize = m.views.iter().map(|v| v.frames).sum();
    let [f0, f1] = range(&|v| v.frames as f64);
    let each = if f0 == f1 { format!("{f0} a view") } else { format!("{f0} to {f1} a view") };
    let (name, views, all) =
        (&recording.sensor.name, m.views.len(), m.views.len() + m.excluded.len());
    format!(
        "{name}: {views} of {all} views measured, {frames} frames ({each}), z {z0:.2} to {z1:.2} m, tilt {t0:.1} to {t1:.1} degrees"
    )
}
