//! A NumPy array of depth images as a film: frames x rows x columns, or one image.
//!
//! A .npy file is treated as a folder of PNGs: the sensor is described by options and, without timestamps,
//! every still stretch counts. A .npz archive may hold more arrays: `K` (3 x 3, or fx, fy, cx, cy), `D` (k1,
//! k2, p1, p2, k3), `timestamps` (s, one per frame) and `units_per_metre`.

use std::path::Path;
use std::sync::Arc;

use super::blocks::Source;
use super::npy::{Fault, Header, MAX_HEADER};
use super::npz::{Body, Member, members};
use super::pixels::Pixels;
use super::scale::{Scale, words};
use crate::camera::{Camera, usable_size};
use crate::error::{Error, Result};
use crate::frame::{DepthCode, Frame};
use crate::io::assumed::Assumed;
use crate::io::folder::NOMINAL_INTERVAL_S;
use crate::io::list::LATEST_S;
use crate::io::stills::{Film, Footage};
use crate::view::{FrameRef, FrameStore, Sensor, Within};

const REMEDY: &str = "save frames x rows x columns with np.save";
const REMEDY_CUT: &str = "the file is cut or damaged; save it again with np.save";

/// An array's header and data.
#[derive(Debug)]
struct Array {
    path: std::path::PathBuf,
    /// Name in an archive.
    name: Option<String>,
    header: Header,
    body: Body,
}

impl Array {
    /// The array, or why it is no stack of depth images and its number of dimensions, where it is whole.
    /// Fails if it is a stack in Fortran's order, the data are shorter than the header says, or the header is not understood.
    fn open(path: &Path, member: Option<&Member>) -> Result<Result<Self, (Error, usize)>> {
        let name = member.map(|m| m.name.clone());
        let source = Source::open(path)?;
        let size = member.map_or(source.length, |m| m.size);
        let body = match member {
            Some(member) => Body::of(source, member),
            None => Body::Plain { source, at: 0 },
        };
        let first = body.bytes(0, size.min(MAX_HEADER), "the header of an array")?;
        let array = |header| Array { path: path.into(), name: name.clone(), header, body };
        let header = match Header::read(&first) {
            Ok(header) => header,
            Err(Fault::Numbers(why, dimensions)) => {
                return Ok(Err((wrong(path, &name, why, REMEDY), dimensions)));
            }
            // A stack may be the depth itself, which no other stack stands for.
            Err(Fault::Order(why, dimensions)) if dimensions < 3 => {
                return Ok(Err((wrong(path, &name, why, REMEDY), dimensions)));
            }
            Err(Fault::Order(why, _)) => return Err(wrong(path, &name, why, REMEDY)),
            Err(Fault::Other(why)) => return Err(wrong(path, &name, why, REMEDY)),
        };
        let there = size.saturating_sub(header.length);
        if header.bytes().is_none_or(|n| n > there) {
            let what =
                format!("the shape {:?} needs more than the {there} bytes there", header.shape);
            return Err(wrong(path, &name, what, REMEDY_CUT));
        }
        Ok(Ok(array(header)))
    }

    fn wrong(&self, what: impl Into<String>, remedy: &'static str) -> Error {
        wrong(&self.path, &self.name, what.into(), remedy)
    }

    /// Frames, rows, columns.
    fn images(&self) -> Option<[usize; 3]> {
        match self.header.shape[..] {
            [frames, rows, columns] | [frames, rows, columns, 1] => Some([frames, rows, columns]),
            [rows, columns] => Some([1, rows, columns]),
            _ => None,
        }
    }

    /// All values of a small array.
    fn values(&self) -> Result<Vec<f64>> {
        let n = self.header.bytes().unwrap_or(0);
        Ok(self.header.number.values(&self.body.bytes(self.header.length, n, "an array")?))
    }
}

fn wrong(path: &Path, name: &Option<String>, what: String, remedy: &'static str) -> Error {
    let array = name.as_ref().map_or_else(String::new, |name| format!("array {name}: "));
    Error::recording(path, format!("{array}{what}"), remedy)
}

pub fn open_npy(path: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    if let Some(topic) = &assumed.topic {
        return Err(Error::Argument {
            what: format!("--topic {topic}: {} is one array", path.display()),
            remedy: "leave the option out",
        });
    }
    let array = Array::open(path, None)?.map_err(|(e, _)| e)?;
    film(array, Beside::default(), assumed)
}

pub fn open_npz(path: &Path, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let is_used =
        |name: &str| BESIDE.contains(&name) || assumed.topic.as_deref().is_some_and(|t| t == name);
    let members = members(path)?;
    let (mut arrays, mut unread) = (Vec::new(), None);
    // Where the depth is named, only it and what is read beside it must be readable.
    for member in members.iter().filter(|m| assumed.topic.is_none() || is_used(&m.name)) {
        match Array::open(path, Some(member))? {
            Ok(array) => arrays.push(array),
            Err((e, _)) if is_used(&member.name) => return Err(e),
            Err((e, dimensions)) => unread = unread.or((dimensions > 2).then_some(e)),
        }
    }
    let stacks: Vec<usize> =
        (0..arrays.len()).filter(|&i| arrays[i].header.shape.len() > 2).collect();
    let all = || members.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
    let chosen = match (&assumed.topic, &stacks[..]) {
        (Some(topic), _) => {
            arrays.iter().position(|a| a.name == Some(topic.clone())).ok_or_else(|| {
                let what = format!("there is no array {topic}; these are: {}", all());
                Error::recording(path, what, "give one of them to --topic")
            })?
        }
        (None, [only]) => *only,
        (None, []) => {
            if let Some(unread) = unread {
                return Err(unread);
            }
            let what = format!("no array is a stack of images; these are: {}", all());
            return Err(Error::recording(path, what, REMEDY));
        }
        (None, _) => {
            let names: Vec<&str> =
                stacks.iter().filter_map(|&i| arrays[i].name.as_deref()).collect();
            let what = format!("several arrays are stacks of images: {}", names.join(", "));
            return Err(Error::recording(path, what, "choose one with --topic"));
        }
    };
    let depth = arrays.swap_remove(chosen);
    let beside = Beside::of(&arrays)?;
    film(depth, beside, assumed)
}

/// Names of the arrays that are read beside the images.
const BESIDE: [&str; 7] =
    ["K", "intrinsics", "D", "distortion", "units_per_metre", "timestamps", "stamps"];

/// What an archive contains besides its images.
#[derive(Default)]
struct Beside {
    intrinsics: Option<[f64; 4]>,
    distortion: Option<[f64; 5]>,
    stamps: Option<Vec<f64>>,
    units_per_metre: Option<f64>,
}

impl Beside {
    fn of(arrays: &[Array]) -> Result<Self> {
        let named = |names: &[&str]| {
            arrays.iter().find(|a| a.name.as_deref().is_some_and(|n| names.contains(&n)))
        };
        let mut beside = Beside::default();
        if let Some(k) = named(&["K", "intrinsics"]) {
            beside.intrinsics = Some(match (&k.header.shape[..], &k.values()?[..]) {
                ([3, 3], [fx, _, cx, _, fy, cy, ..]) => [*fx, *fy, *cx, *cy],
                ([4], [fx, fy, cx, cy]) => [*fx, *fy, *cx, *cy],
                _ => return Err(k.wrong("it is not 3 x 3, nor fx, fy, cx, cy", REMEDY_K)),
            });
        }
        if let Some(d) = named(&["D", "distortion"]) {
            let mut values = d.values()?;
            if values.len() > 5 && values[5..].iter().any(|&k| k != 0.0) {
                return Err(d.wrong("more than k1, k2, p1, p2, k3", REMEDY_K));
            }
            values.resize(5, 0.0);
            let bent = values.iter().any(|&k| k != 0.0);
            beside.distortion = values.try_into().ok().filter(|_| bent);
        }
        if let Some(units) = named(&["units_per_metre"]) {
            beside.units_per_metre = units.values()?.first().copied();
        }
        if let Some(stamps) = named(&["timestamps", "stamps"]) {
            beside.stamps = Some(stamps.values()?);
        }
        Ok(beside)
    }

    /// Fails where the arrays that no option replaces cannot belong to these frames, rows and columns.
    fn check(
        &self,
        images: &Array,
        [count, height, width]: [usize; 3],
        assumed: &Assumed,
    ) -> Result<()> {
        let are_times = |s: &Vec<f64>| {
            let times = s.iter().all(|t| t.abs() < LATEST_S);
            s.len() == count && times && s.is_sorted_by(|a, b| a <= b)
        };
        if !self.stamps.as_ref().is_none_or(are_times) {
            let what =
                format!("its {count} images do not have as many timestamps in seconds, in order");
            return Err(images.wrong(what, "save one a frame, in seconds"));
        }
        let own = self.intrinsics.filter(|_| assumed.intrinsics.is_none());
        let camera = own.and_then(|[fx, fy, cx, cy]| {
            Camera { width, height, fx, fy, cx, cy, distortion: None }.fault()
        });
        if let Some(fault) = camera {
            let what = format!("its intrinsics: {fault}");
            return Err(Error::recording(&images.path, what, REMEDY_K));
        }
        let own = self.code().filter(|_| assumed.code.is_none());
        match own.and_then(|code| code.fault()) {
            Some(fault) => Err(Error::recording(&images.path, fault, REMEDY_UNITS)),
            None => Ok(()),
        }
    }

    fn code(&self) -> Option<DepthCode> {
        let metric = |units_per_metre| DepthCode::Metric { units_per_metre, invalid: 0 };
        self.units_per_metre.map(metric)
    }
}

const REMEDY_K: &str = "correct it, or leave it out and give --intrinsics fx,fy,cx,cy";
const REMEDY_UNITS: &str = "correct it, or leave it out and give --units-per-metre";

#[derive(Debug)]
struct Stack {
    array: Array,
    size: (usize, usize),
    /// For floats: stored values per metre, and output words per metre.
    values_per_metre: f64,
    units_per_metre: f64,
}

impl Stack {
    fn pixels(&self, index: usize) -> Result<Pixels> {
        let Header { number, length, .. } = self.array.header;
        let n = (self.size.0 * self.size.1 * number.size) as u64;
        let what = self.place(index);
        let bytes = self.array.body.bytes(length + index as u64 * n, n, &what)?;
        number.pixels(&bytes, self.values_per_metre).map_err(|why| {
            let what = format!("{what}: {why}");
            Error::recording(
                &self.array.path,
                what,
                "save depth as 16-bit integers, or as floats in metres",
            )
        })
    }
}

impl FrameStore for Stack {
    fn frame(&self, index: usize) -> Result<Frame> {
        let (width, height) = self.size;
        let raw = match self.pixels(index)? {
            Pixels::Words(raw) => raw,
            Pixels::Metres(metres) => words(&metres, self.units_per_metre),
        };
        Ok(Frame { width, height, raw })
    }

    fn place(&self, index: usize) -> String {
        match &self.array.name {
            Some(name) => format!("frame {index} of {name}"),
            None => format!("frame {index}"),
        }
    }
}

fn film(array: Array, beside: Beside, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let Some([count, height, width]) = array.images().filter(|[n, ..]| *n > 0) else {
        let what = format!("its shape is {:?}, which are no images", array.header.shape);
        return Err(array.wrong(what, REMEDY));
    };
    if !usable_size(width, height) {
        return Err(array.wrong(format!("images of {width} x {height} px are not usable"), REMEDY));
    }
    let path = array.path.clone();
    beside.check(&array, [count, height, width], assumed)?;
    let given = Assumed {
        intrinsics: assumed.intrinsics.or(beside.intrinsics),
        code: assumed.code.or(beside.code()),
        ..assumed.clone()
    };
    if given.intrinsics.is_none() && given.preset.is_none() {
        const GIVE: &str = "give --intrinsics fx,fy,cx,cy in pixels, or --sensor";
        return Err(array.wrong("it carries no intrinsics", GIVE));
    }
    let stamps = beside.stamps;
    let mut remarks = Vec::new();
    let mut stack =
        Stack { array, size: (width, height), values_per_metre: 1.0, units_per_metre: 1.0 };
    let own_code = if stack.array.header.number.is_float() {
        let (code, said) = float_code(&mut stack, count, given.code)?;
        remarks.extend(said);
        Some(code)
    } else {
        given.code
    };
    let store: Arc<dyn FrameStore> = Arc::new(stack);
    let stamp = |i: usize| stamps.as_ref().map_or(i as f64 * NOMINAL_INTERVAL_S, |s| s[i]);
    let frame = |index: usize| FrameRef {
        timestamp: stamp(index),
        path: path.clone(),
        within: Some(Within { store: store.clone(), index }),
    };
    let frames: Vec<FrameRef> = (0..count).map(frame).collect();
    let known = Assumed { code: own_code, ..given };
    let (mut sensor, remark) = known.images_sensor(&path, &frames)?;
    remarks.extend(remark);
    if assumed.intrinsics.is_none() {
        sensor.camera.distortion = beside.distortion;
        if let Some(fault) = sensor.fault() {
            return Err(Error::recording(&path, fault, REMEDY_K));
        }
    }
    let film = if stamps.is_some() { Film::Video } else { Film::Captures };
    Ok((Footage { frames, film, remarks, ..Footage::default() }, sensor))
}

/// Depth code for floats, which are in metres unless `given` says otherwise.
fn float_code(
    stack: &mut Stack,
    count: usize,
    given: Option<DepthCode>,
) -> Result<(DepthCode, Option<String>)> {
    match given {
        None => {}
        Some(DepthCode::Metric { units_per_metre, .. }) => stack.values_per_metre = units_per_metre,
        Some(DepthCode::Disparity { .. }) => {
            return Err(Error::Argument {
                what: "floats are no raw disparities".into(),
                remedy: "leave --raw-disparity out",
            });
        }
    }
    let mut scale = Scale::new();
    for index in 0..count {
        if let Pixels::Metres(metres) = stack.pixels(index)? {
            scale.add(&metres);
        }
    }
    let (code, said) = scale
        .code()
        .map_err(|what| stack.array.wrong(what, "give --units-per-metre (1000 for millimetres)"))?;
    if let DepthCode::Metric { units_per_metre, .. } = code {
        stack.units_per_metre = units_per_metre;
    }
    Ok((code, said))
}
