//! The vendors' figures, compared with an independent numpy version written from the tool's readme.

use std::process::Command;

use serde_json::Value;

use super::export_programs::{python_with, run};
use crate::common::{good, kinoise};

/// Computes distances, the plane by its normal equations in z, and errors of every frame of the given views.
const ORACLE: &str = "
import json, os, sys, zlib, struct
import numpy as np

def png16(path):
    data, at, chunks = open(path, 'rb').read(), 8, b''
    while at < len(data):
        size, kind = struct.unpack('>I4s', data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b'IHDR':
            width, height = struct.unpack('>II', body[:8])
        if kind == b'IDAT':
            chunks += body
        at += 12 + size
    raw, out, stride = zlib.decompress(chunks), np.zeros((height, 2 * width), np.int64), 2 * width
    for v in range(height):
        kind, line = raw[v * (stride + 1)], np.frombuffer(raw, np.uint8, stride, v * (stride + 1) + 1).astype(int)
        above = out[v - 1] if v else np.zeros(stride, int)
        for k in range(stride):
            left, up, corner = (out[v, k - 2] if k > 1 else 0), above[k], (above[k - 2] if k > 1 else 0)
            p = left + up - corner
            far = [abs(p - left), abs(p - up), abs(p - corner)]
            paeth = (left, up, corner)[far.index(min(far))]
            out[v, k] = (line[k] + (0, left, up, (left + up) // 2, paeth)[kind]) & 255
    return out[:, 0::2] * 256 + out[:, 1::2]

root, views = sys.argv[1], sys.argv[2:]
s = json.load(open(root + '/recording.json'))
found = []
for view in views:
    frames = []
    names = [l.split()[1] for l in open(f'{root}/{view}/depth.txt') if not l.startswith('#')]
    u0, v0, u1, v1 = json.load(open(f'{root}/{view}/view.json'))['roi']
    gt = json.load(open(f'{root}/{view}/view.json'))['reference_distance_m']
    stack = []
    for name in names:
        z = png16(f'{root}/{view}/{name}')[v0:v1 + 1, u0:u1 + 1] / s['units_per_metre']
        stack.append(z)
        v, u = np.mgrid[v0:v1 + 1, u0:u1 + 1]
        seen = z > 0
        p = np.array([(u - s['cx']) / s['fx'] * z, (v - s['cy']) / s['fy'] * z, z])[:, seen].T
        # Least squares along the axis across which the points spread the most.
        cov = np.cov(p.T)
        axis = int(np.argmax([np.linalg.det(np.delete(np.delete(cov, k, 0), k, 1)) for k in range(3)]))
        others = [k for k in range(3) if k != axis]
        slopes = np.linalg.lstsq(np.column_stack([p[:, others], np.ones(len(p))]), p[:, axis], rcond=None)[0]
        n = np.zeros(3)
        n[axis], n[others], d = 1.0, -slopes[:2], -slopes[2]
        n, d = n / np.linalg.norm(n), d / np.linalg.norm(n)
        if n @ p.mean(axis=0) < 0:
            n, d = -n, -d
        order = np.argsort(p[:, 2], kind='stable')
        cut = len(p) // 200
        p = p[order[cut:len(p) - cut]]
        off = p @ n + d
        zp = (p - off[:, None] * n)[:, 2]
        bf = s['fx'] * s['baseline_m']
        pivot = -d / n[2]
        frames.append({
            'fill_rate': seen.mean(), 'distance_m': -d, 'axis_distance_m': pivot,
            'tilt_rad': np.arccos(abs(n[2])), 'plane_fit_rms_m': np.sqrt(np.mean(off**2)),
            'plane_fit_rms': np.sqrt(np.mean(off**2)) / -d,
            'subpixel_rms_px': np.sqrt(np.mean((bf / p[:, 2] - bf / zp)**2)),
            'z_accuracy': np.sort(pivot - gt + off)[len(off) // 2] / gt})
    stack = np.array(stack)
    stack[stack == 0] = np.nan
    with np.errstate(all='ignore'):
        shares = np.nanstd(stack, axis=0) / np.nanmedian(stack, axis=0)
    found.append({'frames': frames, 'temporal_noise': np.nanmedian(shares)})
print(json.dumps(found))
";

#[test]
fn the_figures_are_the_tools() {
    let Some(python) = python_with("zlib") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("recording");
    crate::common::copy_tree(good(), &recording);
    let mut names: Vec<String> = std::fs::read_dir(&recording)
        .expect("read")
        .map(|entry| entry.expect("an entry"))
        .filter(|entry| entry.path().is_dir())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    // A region that a far tilted board does not quite fill, and the same reference distance everywhere.
    for name in &names {
        let path = recording.join(name).join("view.json");
        let text = std::fs::read_to_string(&path).unwrap_or("{}".into());
        let mut notes: Value = serde_json::from_str(&text).expect("JSON");
        notes["roi"] = serde_json::json!([70, 50, 89, 69]);
        notes["reference_distance_m"] = serde_json::json!(1.99);
        notes.as_object_mut().expect("an object").remove("polygon");
        std::fs::write(&path, notes.to_string()).expect("written");
    }
    let mut oracle = Command::new(&python);
    oracle.args(["-c", ORACLE]).arg(&recording).args(&names);
    let truth: Vec<Value> = serde_json::from_str(&run(&mut oracle)).expect("JSON");

    let out = folder.path().join("out");
    let mut command = kinoise();
    let run = command.args(["metrics", "--json"]).arg(&recording).arg("-o").arg(&out).output();
    let run = run.expect("started");
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success() && said.contains("plane-fit RMS"), "{said}");
    let found: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let views = found["views"].as_array().expect("views");
    assert_eq!(views.len(), names.len(), "{said}");
    for ((name, found), truth) in names.iter().zip(views).zip(&truth) {
        assert_eq!(&found["view"], name);
        near(name, "temporal_noise", &found["temporal_noise"], &truth["temporal_noise"]);
        let [frames, expected] = [found, truth].map(|v| v["frames"].as_array().expect("frames"));
        assert_eq!(frames.len(), expected.len());
        for (frame, expected) in frames.iter().zip(expected) {
            for (key, truth) in expected.as_object().expect("figures") {
                near(name, key, &frame[key], truth);
            }
        }
    }
    let page = std::fs::read_to_string(out.join("report.html")).expect("a page");
    assert!(page.contains("Z-accuracy") && page.contains(&names[0]));
    let file = std::fs::read_to_string(out.join("metrics.json")).expect("a file");
    assert_eq!(serde_json::from_str::<Value>(&file).expect("JSON"), found);
}

/// Asserts equality to a relative error of 1e-6.
fn near(view: &str, key: &str, found: &Value, truth: &Value) {
    let [a, b] = [found, truth].map(|v| v.as_f64().unwrap_or(f64::NAN));
    assert!((a - b).abs() <= 1e-6 * b.abs(), "{view} {key}: {a}, not {b}");
}
