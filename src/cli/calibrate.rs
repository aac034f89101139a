use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use kinoise::calibrate::{Measurements, measure, model_of};
use kinoise::io::{OutputFolder, open};
use kinoise::measure::{MeasureOptions, read_table, write_measurements};
use kinoise::report::{CalibrationPage, Overlay, calibration_page, figure2, sigma_map};
use kinoise::units::counted;
use kinoise::{CalibrateOptions, Calibration, Form, Recording, SigmaKind, model_of_table, stats};

use super::calibrate_summary::{as_json, comparison, formula};
use super::common::{Global, Input, between, one_of, source_date};
use super::console::{
    beside, detail, detail_recording, next_step, notes, result_lines, say, say_lines, working,
};
use super::origin::origin;
use super::output::{CALIBRATION, begin};

#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise calibrate recording -o out/kinect
  kinoise calibrate pngs -o out/kinect --intrinsics 525,525,319.5,239.5 --units-per-metre 1000")]
pub struct Arguments {
    /// A recording, a TUM folder, a fakenect dump, a folder of 16-bit PNGs, a ROS bag (.bag, .mcap, .db3),
    /// a NumPy stack (.npy, .npz), or a table z_m,theta_rad,sigma_m[,n] (.csv)
    recording: PathBuf,
    /// Folder for model.json, measurements.csv, sigma.svg and report.html
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten, next_help_heading = "Fit")]
    fitting: Fitting,
    #[command(flatten, next_help_heading = "Measurement")]
    measuring: Measuring,
    #[command(flatten, next_help_heading = super::INPUT_HEADING)]
    input: Input,
}

#[derive(Debug, Args)]
struct Measuring {
    /// The standard deviation that the model describes
    #[arg(long, default_value = "spatial", value_parser = one_of([
        ("spatial", "Over the pixels of a frame", SigmaKind::Spatial),
        ("temporal", "Of a pixel over the frames", SigmaKind::Temporal),
        ("total", "Over pixels and frames together", SigmaKind::Total),
        ("paper", "Across the plane, by the paper's method", SigmaKind::Paper),
    ]))]
    sigma: SigmaKind,
    /// The paper's RANSAC threshold in m [default: 3 robust standard deviations of the view]
    #[arg(long, value_name = "M", allow_hyphen_values = true, value_parser = between(1e-6, 1.0, "m"))]
    ransac_threshold: Option<f64>,
}

/// `kinoise fit`: what `kinoise calibrate` does with a table.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  kinoise fit table.csv -o out/table
  kinoise fit table.csv -o out/table --form auto")]
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
    /// paper, nguyen, khoshelham or disparity; auto takes what predicts left-out distances best
    #[arg(long, default_value = "paper", value_name = "FORM")]
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
        let Measuring { sigma, ransac_threshold } = self.measuring;
        let measure = MeasureOptions {
            ransac_threshold_m: ransac_threshold,
            seed: global.seed(),
            ..MeasureOptions::default()
        };
        let (form, created) = (self.fitting.form()?, source_date());
        Ok(CalibrateOptions { measure, kind: sigma, form, created })
    }

    /// Whether the input is a file whose name ends in .csv.
    fn is_table(&self) -> bool {
        let csv = self.recording.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
        csv && self.recording.is_file()
    }

    /// Refuses the options of the measurement: a table has no frames to measure.
    fn refuse_measuring(&self) -> anyhow::Result<()> {
        let Measuring { sigma, ransac_threshold } = self.measuring;
        let options = [
            ("--sigma", sigma != SigmaKind::Spatial),
            ("--ransac-threshold", ransac_threshold.is_some()),
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
    let out = begin(&arguments.output, CALIBRATION, &[&arguments.recording], global)?;
    let (measured, calibration) = calibrate(&recording, &options, out, overlays)?;
    global.print_json(&as_json(&calibration, Some(&measured)))?;
    let mut next = vec!["diagnose".into(), arguments.recording.clone().into(), "-o".into()];
    next.push(beside(&arguments.output, "diagnosis").into());
    next_step(&[next, arguments.input.again()].concat());
    Ok(())
}

pub fn fit(arguments: &FitArguments, global: &Global) -> anyhow::Result<()> {
    table(&arguments.table, &arguments.output, &arguments.fitting, global)
}

/// Fits a table and writes the results.
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
        origin: &origin(file, global.seed().0),
    };
    write_outputs(begin(output, CALIBRATION, &[file], global)?, &page)?;
    global.print_json(&as_json(&calibration, None))?;
    let simulated = beside(output, "simulated");
    let model = output.join("model.json");
    next_step(&["simulate".into(), simulated.into(), "-m".into(), model.into()]);
    Ok(())
}

/// Measures, fits, writes every output and reports.
pub fn calibrate(
    recording: &Recording,
    options: &CalibrateOptions,
    out: OutputFolder,
    overlays: &[Overlay],
) -> anyhow::Result<(Measurements, Calibration)> {
    detail_recording(recording);
    detail(format!("settings: {options:?}"));
    let measurements = working("measuring", |step| measure(recording, &options.measure, step))?;
    say(measured(recording, &measurements));
    out.write("measurements.csv", write_measurements(&measurements.views).as_bytes())?;
    let fitted = working("fitting", |_| {
        model_of(recording, &measurements, options).map_err(|e| e.of(&recording.root))
    });
    let calibration = match fitted {
        Ok(calibration) => calibration,
        Err(why) => {
            // Without a model there is no list of warnings: these are shown nowhere else.
            notes(&measurements.excluded);
            notes(&recording.remarks);
            let told = measured_only(out)?;
            return Err(why).context(told);
        }
    };
    let page = CalibrationPage {
        title: &format!("Noise of {}", recording.sensor.name),
        sensor: Some(&recording.sensor),
        measurements: Some(&measurements),
        calibration: &calibration,
        overlays,
        origin: &origin(&recording.root, options.measure.seed.0),
    };
    write_outputs(out, &page)?;
    Ok((measurements, calibration))
}

/// Keeps the measurements of views that no model fits, unless they would replace an earlier run's model.
/// Returns the message.
fn measured_only(out: OutputFolder) -> anyhow::Result<String> {
    let place = out.place().to_path_buf();
    if out.replaces() {
        let stands = format!("{} stays as it was", place.display());
        return Ok(format!("the views were measured but no model was fitted, and {stands}"));
    }
    out.finish()?;
    let measurements = place.join("measurements.csv");
    Ok(format!("the views were measured ({}) but no model was fitted", measurements.display()))
}

/// Writes the model, figures and page, and prints a summary. A fit that explains nothing leaves no model
/// unless forced.
fn write_outputs(out: OutputFolder, page: &CalibrationPage<'_>) -> anyhow::Result<()> {
    let calibration = page.calibration;
    let (table, sigma) = (&calibration.table, &calibration.model.sigma);
    let names = page.names();
    let charts = [
        ("sigma", figure2(table, sigma, page.overlays, &names)),
        ("sigma_map", sigma_map(table, sigma, &names)),
    ];
    working("drawing", |_| -> anyhow::Result<()> {
        for (name, chart) in charts {
            out.write(&format!("{name}.svg"), chart.svg()?.as_bytes())?;
            out.write(&format!("{name}.png"), &chart.png()?)?;
        }
        out.write("report.html", calibration_page(page)?.as_bytes())?;
        Ok(())
    })?;
    let useless = calibration.fit.is_no_model().filter(|_| !out.forced());
    if useless.is_none() {
        calibration.model.write(&out.path().join("model.json"))?;
    }
    let place = out.place().to_path_buf();
    out.finish()?;
    if useless.is_none() {
        let beside = "with sigma.svg, sigma_map.svg and report.html beside it";
        say(format!("wrote {}, {beside}\n", place.join("model.json").display()));
    }
    result_lines(formula(calibration));
    say_lines(comparison(calibration));
    notes(&calibration.warnings);
    if let Some((what, remedy)) = useless {
        let page = place.join("report.html");
        bail!(
            "{}: {what} and no model.json was written; {remedy}, or write it with --force",
            page.display()
        );
    }
    Ok(())
}

fn measured(recording: &Recording, m: &Measurements) -> String {
    let range = |f: &dyn Fn(&kinoise::ViewMeasurement) -> f64| stats::range(m.views.iter().map(f));
    let [z0, z1] = range(&|v| v.z_m);
    let [t0, t1] = range(&|v| v.theta_rad.to_degrees());
    let frames: usize = m.views.iter().map(|v| v.frames).sum();
    let [f0, f1] = range(&|v| v.frames as f64);
    let each = if f0 == f1 { format!("{f0} a view") } else { format!("{f0} to {f1} a view") };
    let (name, views, frames) = (&recording.sensor.name, m.views.len(), counted(frames, "frame"));
    let all = counted(views + m.excluded.len(), "view");
    let places = format!("z {z0:.2} to {z1:.2} m, tilt {t0:.1} to {t1:.1} degrees");
    format!("{name}: {views} of {all} measured, {frames} ({each}), {places}")
}
