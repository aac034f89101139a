//! A topic of depth images as the frames of a film.

use std::sync::Arc;

use rayon::prelude::*;

use super::bag::{Bag, Topic};
use super::camera::camera;
use super::messages::{HEAD_BYTES, ImageHead, seconds, temperature};
use super::pixels::{Encoding, Pixels};
use super::realsense::Device;
use super::scale::{Scale, words};
use super::topics::{DepthTopic, damaged, depth_topic, place};
use crate::error::{Error, Result};
use crate::frame::{DepthCode, Frame};
use crate::io::assumed::Assumed;
use crate::io::stills::{Film, Footage};
use crate::units::{counted, verb};
use crate::view::{FrameRef, FrameStore, Sensor, Within};

/// Millimetres: the ROS convention for 16UC1 (REP 118).
const MILLIMETRES: DepthCode = DepthCode::Metric { units_per_metre: 1000.0, invalid: 0 };

#[derive(Debug)]
struct BagFilm {
    bag: Box<dyn Bag>,
    topic: usize,
    encoding: Encoding,
    /// For float depths.
    units_per_metre: f64,
    /// Message number of each frame.
    numbers: Vec<usize>,
}

impl FrameStore for BagFilm {
    fn frame(&self, index: usize) -> Result<Frame> {
        let number = self.numbers[index];
        let ((width, height), pixels) = decode(&*self.bag, self.topic, number, self.encoding)?;
        let raw = match pixels {
            Pixels::Words(raw) => raw,
            Pixels::Metres(metres) => words(&metres, self.units_per_metre),
        };
        Ok(Frame { width, height, raw })
    }

    fn place(&self, index: usize) -> String {
        place(&*self.bag, self.topic, self.numbers[index])
    }
}

/// Opens the depth film in a bag and describes its sensor.
/// Fails if a message is damaged, or if the intrinsics are unknown.
pub fn open(bag: impl Bag + 'static, assumed: &Assumed) -> Result<(Footage, Sensor)> {
    let depth = depth_topic(&bag, assumed.topic.as_deref())?;
    let survey = Survey::of(&bag, depth)?;
    let mut remarks = Vec::new();
    let sensor = sensor(&bag, depth, &survey, assumed, &mut remarks)?;
    let units_per_metre = match sensor.code {
        DepthCode::Metric { units_per_metre, .. } => units_per_metre,
        DepthCode::Disparity { .. } => 0.0,
    };
    let temperatures = temperatures(&bag, &mut remarks)?;
    let order = survey.in_order(&mut remarks, &bag.topics()[depth.topic].name);
    let path = bag.path().to_path_buf();
    let numbers = order.iter().map(|(_, number)| *number).collect();
    let DepthTopic { topic, encoding } = depth;
    let film = BagFilm { bag: Box::new(bag), topic, encoding, units_per_metre, numbers };
    let store: Arc<dyn FrameStore> = Arc::new(film);
    let frame = |(index, (stamp, _)): (usize, &(i64, usize))| FrameRef {
        timestamp: seconds(*stamp),
        path: path.clone(),
        within: Some(Within { store: store.clone(), index }),
    };
    let frames = order.iter().enumerate().map(frame).collect();
    let footage =
        Footage { frames, film: Film::Video, remarks, described_by: Vec::new(), temperatures };
    Ok((footage, sensor))
}

fn decode(
    bag: &dyn Bag,
    topic: usize,
    number: usize,
    encoding: Encoding,
) -> Result<((usize, usize), Pixels)> {
    let message = bag.message(topic, number, u64::MAX)?;
    let head = ImageHead::read(&message.bytes, bag.topics()[topic].dialect, encoding.is_raw);
    let decoded = head.and_then(|head| encoding.decode(&head, &message.bytes));
    decoded.map_err(|damage| damaged(bag, topic, number, &damage))
}

/// What the headers of a topic's messages say, and for float depths their statistics.
struct Survey {
    stamps_ns: Vec<i64>,
    /// Whether no image has a timestamp, so that the time of writing is used.
    unstamped: bool,
    size: (usize, usize),
    scale: Option<Scale>,
}

impl Survey {
    fn of(bag: &dyn Bag, depth: DepthTopic) -> Result<Self> {
        let Topic { logged_ns, .. } = &bag.topics()[depth.topic];
        let numbers = || (0..logged_ns.len()).into_par_iter();
        // The first error in frame order, not the first that a thread meets.
        let heads: Vec<Result<(i64, (usize, usize))>> =
            numbers().map(|number| Self::head(bag, depth, number)).collect();
        let heads = heads.into_iter().collect::<Result<Vec<_>>>()?;
        let mut stamps_ns: Vec<i64> = heads.iter().map(|h| h.0).collect();
        let unstamped = stamps_ns.iter().all(|&ns| ns == 0);
        if unstamped {
            stamps_ns.clone_from(logged_ns);
        }
        // The size of a compressed image is in its data.
        let size = match depth.encoding.is_raw {
            true => heads.first().map_or((0, 0), |h| h.1),
            false => decode(bag, depth.topic, 0, depth.encoding)?.0,
        };
        let add = |mut scale: Scale, number: usize| {
            if let (_, Pixels::Metres(metres)) = decode(bag, depth.topic, number, depth.encoding)? {
                scale.add(&metres);
            }
            Ok(scale)
        };
        let scale = match depth.encoding.is_float {
            // Sums of integers: the result does not depend on the split among threads.
            true => {
                let sums = numbers().try_fold(Scale::new, add);
                Some(sums.try_reduce(Scale::new, |a, b| Ok(a.merged(b)))?)
            }
            false => None,
        };
        Ok(Survey { stamps_ns, unstamped, size, scale })
    }

    /// Timestamp, ns, and size of one image, after checking that its lengths are consistent.
    fn head(
        bag: &dyn Bag,
        DepthTopic { topic, encoding }: DepthTopic,
        number: usize,
    ) -> Result<(i64, (usize, usize))> {
        let damage = |why: String| damaged(bag, topic, number, &why);
        let message = bag.message(topic, number, HEAD_BYTES)?;
        let dialect = bag.topics()[topic].dialect;
        let head = ImageHead::read(&message.bytes, dialect, encoding.is_raw).map_err(damage)?;
        if Encoding::of(&head.encoding, encoding.is_raw) != Some(encoding) {
            let what = format!(
                "{} is \"{}\", which the first message is not",
                place(bag, topic, number),
                head.encoding
            );
            let remedy = "a topic has one encoding: keep the messages before, or those from there on, in a bag of their own";
            return Err(Error::recording(bag.path(), what, remedy));
        }
        match encoding.fault(&head, message.length) {
            Some(fault) => Err(damage(fault)),
            None => Ok((head.stamp_ns, head.size)),
        }
    }

    /// Timestamps and message numbers in time order.
    fn in_order(&self, remarks: &mut Vec<String>, topic: &str) -> Vec<(i64, usize)> {
        let mut order: Vec<(i64, usize)> = self.stamps_ns.iter().copied().zip(0..).collect();
        if self.unstamped {
            remarks
                .push(format!("{topic}: the images have no stamps; the times of writing are used"));
        }
        if !order.is_sorted() {
            order.sort();
            remarks.push(format!("{topic}: timestamps were out of order; frames were sorted"));
        }
        let shared = order.windows(2).filter(|w| w[0].0 == w[1].0).count();
        if shared > 0 {
            remarks.push(format!(
                "{topic}: {} {} the same timestamp as another; all are used",
                counted(shared, "frame"),
                verb(shared, "has", "have")
            ));
        }
        order
    }
}

fn sensor(
    bag: &dyn Bag,
    depth: DepthTopic,
    survey: &Survey,
    assumed: &Assumed,
    remarks: &mut Vec<String>,
) -> Result<Sensor> {
    let topic = &bag.topics()[depth.topic].name;
    let device = Device::of(bag, depth.topic).unwrap_or_default();
    let code = code(bag, topic, &device, survey, assumed, remarks)?;
    let name = device.name.clone().unwrap_or_else(|| format!("depth camera {topic}"));
    let given = Assumed {
        code: Some(code),
        baseline_m: assumed.baseline_m.or(device.baseline_m),
        ..assumed.clone()
    };
    // What the user gives takes precedence, even if the bag's calibration is unreadable.
    let camera = match assumed.intrinsics {
        Some(_) => None,
        None => camera(bag, depth.topic, survey.size)?,
    };
    let mut sensor = match camera {
        Some((camera, said)) => {
            remarks.push(format!("{topic}: {said}"));
            let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy];
            let known = Assumed { intrinsics: Some([fx, fy, cx, cy]), ..given };
            let sensor = known.sensor(&name, survey.size, [fx, fy, cx, cy], code);
            let mut sensor = sensor.map_err(|e| e.of(bag.path()))?;
            sensor.camera = camera;
            sensor
        }
        None if assumed.intrinsics.is_none() && assumed.preset.is_none() => {
            return Err(Error::recording(
                bag.path(),
                format!("no camera_info topic belongs to {topic}"),
                "give --intrinsics fx,fy,cx,cy in pixels, or --sensor",
            ));
        }
        None => {
            let sensor = given.sensor(&name, survey.size, [0.0; 4], code);
            sensor.map_err(|e| e.of(bag.path()))?
        }
    };
    sensor.serial = device.serial;
    match sensor.fault() {
        Some(fault) => Err(Error::recording(bag.path(), fault, "record the bag again")),
        None => Ok(sensor),
    }
}

fn code(
    bag: &dyn Bag,
    topic: &str,
    device: &Device,
    survey: &Survey,
    assumed: &Assumed,
    remarks: &mut Vec<String>,
) -> Result<DepthCode> {
    let Some(scale) = &survey.scale else {
        let own = device.depth_unit_m.map(|unit| DepthCode::Metric {
            units_per_metre: (1e6 / unit).round() * 1e-6,
            invalid: 0,
        });
        return Ok(assumed.code.or(own).unwrap_or(MILLIMETRES));
    };
    if assumed.code.is_some() {
        return Err(Error::Argument {
            what: format!("{topic} holds depths in metres, which need no unit"),
            remedy: "leave --units-per-metre or --raw-disparity out",
        });
    }
    let (code, said) = scale.code().map_err(|what| {
        Error::recording(bag.path(), format!("{topic}: {what}"), "record 32FC1 in metres, or 16UC1")
    })?;
    remarks.extend(said.map(|said| format!("{topic}: {said}")));
    Ok(code)
}

/// Timestamps, s, and degrees Celsius from the temperature topic, if there is exactly one.
fn temperatures(bag: &dyn Bag, remarks: &mut Vec<String>) -> Result<Vec<(f64, f64)>> {
    let is_one = |t: &&Topic| t.kind == "sensor_msgs/Temperature" && !t.logged_ns.is_empty();
    let found: Vec<&Topic> = bag.topics().iter().filter(is_one).collect();
    let [only] = found[..] else {
        if !found.is_empty() {
            let names: Vec<&str> = found.iter().map(|t| &*t.name).collect();
            remarks.push(format!("several temperatures, none is used: {}", names.join(", ")));
        }
        return Ok(Vec::new());
    };
    let topic = bag.topics().iter().position(|t| std::ptr::eq(t, only)).unwrap_or_default();
    let reading = |number: usize| {
        let message = bag.message(topic, number, HEAD_BYTES)?;
        let (stamp, celsius) = temperature(&message.bytes, only.dialect)
            .map_err(|damage| damaged(bag, topic, number, &damage))?;
        let stamp = if stamp == 0 { only.logged_ns[number] } else { stamp };
        Ok((seconds(stamp), celsius))
    };
    let readings: Result<Vec<(f64, f64)>> = (0..only.logged_ns.len()).map(reading).collect();
    let mut readings = readings?;
    readings.retain(|(_, celsius)| celsius.is_finite());
    readings.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(readings)
}
