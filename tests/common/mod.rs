//! Shared test helpers: small recordings with a known truth, images of any kind, the binary.
#![allow(dead_code)] // every test file uses a part

pub mod capture;
pub mod speckle;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use assert_cmd::Command;
use kinoise::model::{Domain, PAPER_EQ1};
use kinoise::scene::{Board, Target};
use kinoise::simulate::{Grid, Shoot, kinect_v1};
use kinoise::{Form, Frame, Seed, SigmaModel};

pub const BOARD_HEIGHT_M: f64 = 0.8;
pub const BOARD: Target = Target::Board(Board { width_m: 1.0, height_m: BOARD_HEIGHT_M });

/// Eq. 1 as published, wherever a board of this size reaches.
pub fn truth() -> SigmaModel {
    let domain = Domain { z_m: [0.2, 10.0], theta_rad: [0.0, 1.37] };
    SigmaModel::published(Form::Paper, &PAPER_EQ1, domain)
}

pub fn grid(distances_m: &[f64], tilts_deg: &[f64]) -> Grid {
    Grid {
        distances_m: distances_m.to_vec(),
        tilts_rad: tilts_deg.iter().map(|t| t.to_radians()).collect(),
    }
}

/// Shots of 160 x 120 px: a view of the good recording takes 20 kB.
pub fn shots(grid: Grid, frames: usize, seed: u64) -> Shoot {
    Shoot::plain(kinect_v1(4), BOARD, &grid.views(), frames, truth(), Seed(seed))
}

/// Views of the good recording: four distances, three tilts, two frames each.
pub const GOOD_VIEWS: usize = 12;

/// A recording with nothing wrong; made once per test program and copied by tests that damage it.
pub fn good() -> &'static Path {
    static GOOD: OnceLock<tempfile::TempDir> = OnceLock::new();
    GOOD.get_or_init(|| {
        // Statics are never dropped; what is left below target/ does no harm.
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a temporary folder");
        shots(grid(&[1.0, 1.5, 2.0, 3.0], &[0.0, 30.0, 60.0]), 2, 1)
            .write(folder.path(), &|_, _| ())
            .expect("the recording is written");
        folder
    })
    .path()
}

pub fn copy_tree(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("made");
    for entry in std::fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_tree(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), &target).expect("copied");
        }
    }
}

/// Writes a PNG of any kind; `data` as PNG stores it (big-endian words).
pub fn write_png(
    path: &Path,
    size: (u32, u32),
    color: png::ColorType,
    depth: png::BitDepth,
    data: &[u8],
) {
    let file = std::fs::File::create(path).expect("made");
    let mut encoder = png::Encoder::new(std::io::BufWriter::new(file), size.0, size.1);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().expect("a header");
    writer.write_image_data(data).expect("pixels");
    writer.finish().expect("an end");
}

pub fn write_depth(path: &Path, frame: &Frame) {
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    std::fs::write(path, kinoise::io::encode_png16(frame).expect("encoded")).expect("written");
}

/// Writes depth frames into a new folder as fakenect-record would: stamps in s, frames of 640 x 480 raw
/// values. fakenect plays nothing else.
pub fn write_dump<'a>(root: &Path, frames: impl IntoIterator<Item = (f64, &'a Frame)>) {
    std::fs::create_dir_all(root).expect("made");
    let mut index = String::new();
    for (stamp, frame) in frames {
        // The sensor's own clock: 60 MHz in 32 bits.
        let ticks = (stamp * 60e6) as u64 as u32;
        let name = format!("d-{stamp:.6}-{ticks}.pgm");
        std::fs::write(root.join(&name), kinoise::io::encode_pgm16(frame)).expect("written");
        index += &name;
        index.push('\n');
    }
    std::fs::write(root.join("INDEX.txt"), index).expect("written");
}

pub fn kinoise() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kinoise"));
    command.env("SOURCE_DATE_EPOCH", "1700000000");
    command
}

/// Path of the real data; `None` where it is missing, after printing what is skipped.
pub fn data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("KINOISE_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"),
        PathBuf::from,
    );
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    println!(
        "skipped: {} is not here; set KINOISE_DATA to the folder of real data",
        path.display()
    );
    None
}

/// All files below a folder with their bytes, in name order.
pub fn tree(root: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(root).expect("below").to_path_buf();
                files.push((name, std::fs::read(&path).expect("read")));
            }
        }
    }
    files.sort();
    files
}
