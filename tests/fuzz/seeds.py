#!/usr/bin/env python3
"""Writes small valid files of every kind that kinoise reads, to begin fuzzing with.

    python3 tests/fuzz/seeds.py target/release/kinoise FOLDER

FOLDER gets a folder a target. Models and diagnoses are kinoise's own; the bags are those of
tests/data/containers; the rest is written here, the JPEG by Pillow.
"""

import io
import json
import shutil
import sqlite3
import struct
import subprocess
import sys
import tempfile
import zipfile
import zlib
from pathlib import Path

CONTAINERS = Path(__file__).parent.parent / "data" / "containers"
WIDTH, HEIGHT = 8, 6
PIXELS = [1500 + 7 * (i % 11) for i in range(WIDTH * HEIGHT)]


def png(colour, bits, data, chunks=()):
    """Rows without filters; `data` as bytes."""

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    row = len(data) // HEIGHT
    rows = b"".join(b"\0" + data[v * row : (v + 1) * row] for v in range(HEIGHT))
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, bits, colour, 0, 0, 0)
    parts = [(b"IHDR", header), *chunks, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in parts)


def npy(descr, shape, data):
    header = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}"
    header += " " * (-(len(header) + 11) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + data


def npz(compression, members):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), data, compression)
    return file.getvalue()


def recordings():
    plain = {
        "format": "recording/1", "sensor": "small", "width": WIDTH, "height": HEIGHT,
        "fx": 8, "fy": 8, "cx": 3.5, "cy": 2.5, "units_per_metre": 1000,
    }
    full = plain | {
        "serial": "A1", "mode": "near", "baseline_m": 0.075, "kind": "structured-light", "invalid": 0,
        "distortion": [0.02, -0.03, 0.001, -0.002, 0.004],
        "intrinsics_uncertainty": {"fx": 0.5, "fy": 0.5, "cx": 1, "cy": 1},
    }
    raw = {k: v for k, v in plain.items() if k != "units_per_metre"}
    raw["raw_disparity"] = {"offset": 3.33, "slope": -0.00307, "invalid": 2047}
    return [json.dumps(r, indent=1) for r in (plain, full, raw)]


def views():
    full = {
        "target": {"width_m": 1.0, "height_m": 0.8, "flatness_m": 0.001}, "reference_distance_m": 1.5,
        "reference_uncertainty_m": 0.002, "roi": [4, 4, 36, 26], "temperature_c": 21.5,
        "ambient_lux": 300, "notes": "a board",
    }
    around = {"polygon": [[3, 3], [36, 4], [35, 27], [4, 26]]}
    return [json.dumps(v) for v in ({}, full, around)]


def lists():
    image = "0.png\n0.1 1.png\n0.2 2.png\n"
    yield b"\0" + f"# depth maps\n0.0 {image}".encode()
    yield b"\1" + f"0.01 {image}".encode()
    yield b"\2" + b"0.0 0.png 0.0 0.png\n0.1 1.png 0.1 1.png\n"
    yield b"\3" + b"# truth\n0 0 0 0 0 0 0 1\n0.1 0 0 0.1 0 0 0.1 0.99\n"


def pictures():
    from PIL import Image

    grey = bytes(v % 256 for v in PIXELS)
    words = struct.pack(f">{len(PIXELS)}H", *PIXELS)
    rgb = bytes(v % 256 for v in PIXELS for _ in range(3))
    yield png(0, 8, grey)
    yield png(0, 16, words)
    yield png(2, 8, rgb)
    yield png(3, 8, bytes(i % 2 for i in range(len(PIXELS))), [(b"PLTE", bytes([0, 0, 0, 255, 128, 0]))])
    jpeg = io.BytesIO()
    Image.frombytes("RGB", (WIDTH, HEIGHT), rgb).save(jpeg, "JPEG")
    yield jpeg.getvalue()


def dumps():
    words = struct.pack(f"<{len(PIXELS)}H", *(600 + v % 400 for v in PIXELS))
    yield b"\1" + f"P5 {WIDTH} {HEIGHT} 65535\n".encode() + words
    yield b"\0d-1.000000-60000000.pgm\nr-1.010000-1.ppm\na-1.020000-2.dump\n"


def models(kinoise):
    """Eq. 1 with effects as formulas, and with each kind of term."""
    paper = fitted(kinoise) | {"effects": []}
    formulas = [
        ("radial-disparity-bias", {"k_px": 0.1}), ("thermal-drift", {}), ("pixel-locking", {}),
        ("range-not-depth", {}), ("depth-scale", {}), ("column-banding", {}), ("vignetting", {}),
    ]
    kinds = [
        {"kind": "bowl", "disparity_power": 1.0, "orders": 2},
        {"kind": "lens", "fx": 36.0, "fy": 36.0, "orders": 1},
        {"kind": "range-not-depth"},
        {"kind": "locking", "period_px": 1.0, "harmonics": 1},
        {"kind": "banding", "period_px": 10.0, "harmonics": 1},
        {"kind": "range-exponent", "pivot_m": 2.0, "orders": 2},
        {"kind": "curve", "over": "log-z", "low": 0.0, "high": 1.0, "nodes": 3, "times": "one"},
        {"kind": "ring", "over": "azimuth", "period": 6.3, "nodes": 4, "times": "tilt"},
        {"kind": "map", "width": 40.0, "height": 30.0, "across": 3, "down": 2, "times": "one"},
        {"kind": "spline", "width": 40.0, "height": 30.0, "across": 4, "down": 4, "times": "one"},
        {"kind": "affine", "disparity_power": 2.0},
    ]
    counts = [2, 1, 1, 2, 2, 2, 3, 4, 6, 16, 3]
    yield paper
    yield paper | {"effects": [{"id": i, "parameters": p} for i, p in formulas]}
    for statistic in ("bias", "variance"):
        for first in range(0, len(kinds), 4):
            terms = [
                {"statistic": statistic, "basis": kind, "coefficients": [0.01] * n}
                for kind, n in zip(kinds[first : first + 4], counts[first : first + 4])
            ]
            shape = {"id": "unexplained", "parameters": {}, "shape": terms, "learnt_px": [5.0, 40.0]}
            yield paper | {"effects": [shape]}


def fitted(kinoise):
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "table.csv"
        table.write_text(TABLE)
        subprocess.run([kinoise, "fit", table, "-o", f"{folder}/out"], check=True, capture_output=True)
        return json.loads((Path(folder) / "out" / "model.json").read_text())


TABLE = "z_m,theta_rad,sigma_m,n\n" + "".join(
    f"{z},{theta},{0.00273 * (z - 0.4) ** 2 / 10 + 0.0011 + 0.00074 * theta:.6f},400\n"
    for z in (0.8, 1.2, 2, 3, 4)
    for theta in (0, 0.4, 0.9)
)
DIAGNOSIS = {
    "findings": [
        {"next_view": {"z_m": 1.5, "theta_rad": 0.5, "azimuth_rad": 1.0, "why": "a or b"}},
        {"next_view": None},
    ],
    "views": [{"name": "z150-t00"}],
}
POSES = "# stamp tx ty tz qx qy qz qw\n" + "".join(
    f"{1305031102 + k / 30:.4f} {0.01 * k} {0.002 * k * k} 0 0 {0.01 * k} 0 1\n" for k in range(12)
)
SCENE = "1 0 0 0.1\n0 1 0 0.2\n0 0 1 0.3\n0 0 0 1\n"


def small_db3():
    """The bag of ROS 2 with three images and what else it has, on small pages."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.db3"
        shutil.copy(CONTAINERS / "film" / "film.db3", path)
        db = sqlite3.connect(path, isolation_level=None)
        db.execute("DELETE FROM messages WHERE id NOT IN (SELECT id FROM messages m WHERE "
                   "(SELECT count(*) FROM messages n WHERE n.topic_id = m.topic_id AND n.id < m.id) < 1)")
        db.execute("PRAGMA page_size = 512")
        db.execute("VACUUM")
        db.close()
        return path.read_bytes()


def stacks():
    words = struct.pack(f"<{2 * len(PIXELS)}H", *(PIXELS * 2))
    metres = struct.pack(f"<{len(PIXELS)}f", *(v / 1000 for v in PIXELS))
    shape = f"(2, {HEIGHT}, {WIDTH})"
    beside = {
        "depth": npy("<u2", shape, words),
        "K": npy("<f8", "(4,)", struct.pack("<4d", 8, 8, 3.5, 2.5)),
        "D": npy("<f8", "(5,)", struct.pack("<5d", 0.02, 0, 0, 0, 0)),
        "timestamps": npy("<f8", "(2,)", struct.pack("<2d", 0, 0.1)),
        "units_per_metre": npy("<f8", "()", struct.pack("<d", 1000)),
    }
    yield npy("<u2", shape, words)
    yield npy("<f4", f"({HEIGHT}, {WIDTH})", metres)
    yield npz(zipfile.ZIP_STORED, beside)
    yield npz(zipfile.ZIP_DEFLATED, beside)


def main():
    kinoise, out = sys.argv[1], Path(sys.argv[2])
    point = struct.pack("<6f3Bf", 0.1, 0.2, 1.5, 0, 0, -1, 10, 20, 30, 0.004)
    seeds = {
        "recording": recordings(), "view": views(), "list": lists(),
        "depth_png": [png(0, 16, struct.pack(f">{len(PIXELS)}H", *PIXELS))],
        "picture": pictures(), "dump": dumps(),
        "model": [json.dumps(model) for model in models(kinoise)],
        "diagnosis": [json.dumps(DIAGNOSIS)],
        "table": [TABLE, "z_m,theta_rad,sigma_m,view\n1,0,0.001,a\n1.1,0,0.0012,a\n2,0.2,0.004,b\n"],
        "trajectory": [POSES], "scenes": [SCENE], "ply": [point * 3],
        "ros1": [(CONTAINERS / name).read_bytes() for name in ("realsense-older.bag", "no-depth.bag")],
        "mcap": [
            (CONTAINERS / name).read_bytes() for name in ("unchunked.mcap", "unindexed.mcap", "kinds.mcap")
        ],
        "db3": [small_db3()],
        "numpy": stacks(),
    }
    for target, files in seeds.items():
        folder = out / target
        folder.mkdir(parents=True, exist_ok=True)
        for k, data in enumerate(files):
            data = data.encode() if isinstance(data, str) else data
            (folder / f"seed-{k}").write_bytes(data)


if __name__ == "__main__":
    main()
