#!/usr/bin/env python3
"""Independent concealed sets: made with numpy only, by other formulas than the catalogue's.

A board in front of a wall at 640 x 480, 18 poses of 4 frames, with white noise of Eq. 1 and one cause. The
model is calibrated on a clean recording of the same sensor or, in three of ten sets, on the concealed recording
itself; there the noise may obey Eq. 1 across the plane. Each set prints a line: the cause and its size, what was
found with its share, and whether the cause's name came first, came at all, or was missed; "out-..." has no name
in the catalogue. A pair has two causes at once: both, one or none of their names are found, or a wrong one too.
It shares nothing with the trial but the layout of a recording. A law of depth and tilt alone
(range-exponent, slope-noise) is part of sigma where the model was calibrated on the same recording.

    foreign_sets.py [--kinoise BIN] [--repeat N] [--seed S] [--jobs J] [--keep DIR] [--pairs N | CAUSE ...]
"""
import argparse, collections, concurrent.futures, contextlib, json, pathlib, subprocess, sys, tempfile

try:
    import numpy as np
    from PIL import Image
    from scipy.ndimage import gaussian_filter
except ImportError as missing:
    sys.exit(f"{missing}: this bench needs python3 with numpy, scipy and Pillow")

WIDTH, HEIGHT, FOCAL, BASELINE, UNITS = 640, 480, 575.0, 0.075, 5000
PX_M = FOCAL * BASELINE
VIEWS, FRAMES, BOARD_M, BEHIND_M, EVERY_S = 18, 4, (1.2, 0.9), 1.6, 45.0
COLUMN, ROW = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
X, Y = (COLUMN - (WIDTH - 1) / 2) / FOCAL, (ROW - (HEIGHT - 1) / 2) / FOCAL
RADIUS = np.hypot(X, Y) / np.hypot(X, Y).max()


def eq1(z, t):
    return 0.00151 + 0.00215 * (z - 0.483) ** 2 + 1.88e-6 * z**2.01 * t**2 / (1.39 - t) ** 2


class Sensor:
    """Its effects on a view `v` beyond white noise; each list holds functions of the view."""

    def __init__(self, rng, across):
        self.rng, self.across = rng, across
        self.bias, self.factor, self.variance, self.lost, self.frame = [], [], [], [], []  # px, -, px^2, chance, px
        self.ray = lambda x, y: (x, y)
        self.depth = lambda z: z
        self.word = lambda w: w
        self.noise = lambda v, k: self.rng.standard_normal((HEIGHT, WIDTH))
        self.bow = self.mixing = self.print = self.reference_m = None
        self.shadow, self.velocity, self.lit = 0.0, 0.0, False

    def record(self, folder):
        folder.mkdir(parents=True)
        about = dict(format="recording/1", sensor="numpy", width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL,
                     cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2, baseline_m=BASELINE, units_per_metre=UNITS)
        (folder / "recording.json").write_text(json.dumps(about))
        distances = np.geomspace(0.9, 3.6, VIEWS) * self.rng.uniform(0.95, 1.05, VIEWS)
        tilts = np.radians(np.linspace(0, 62, VIEWS))
        self.rng.shuffle(distances), self.rng.shuffle(tilts)
        for n, (z, tilt) in enumerate(zip(distances, tilts)):
            self.view(folder / f"{n:03}", z, tilt, self.rng.uniform(0, 2 * np.pi), n * EVERY_S)

    def view(self, folder, z0, tilt, azimuth, time):
        normal = np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
        x, y = self.ray(X, Y)
        slope = normal[0] * x + normal[1] * y + normal[2]
        z = np.where(slope > 0.05, z0 * normal[2] / np.maximum(slope, 0.05), 0)
        right = np.cross([0, 1, 0], normal)
        right /= np.linalg.norm(right)
        point = np.stack([x * z, y * z, z - z0], -1)
        a, b = point @ right, point @ np.cross(normal, right)
        on = (np.abs(a) < BOARD_M[0] / 2) & (np.abs(b) < BOARD_M[1] / 2) & (z > 0.4)
        if self.bow:
            z = z + self.bow(a, b) / np.maximum(slope, 0.2)
        wall = z0 + BEHIND_M
        z = np.where(on, z, wall)
        v = dict(z=z, d=PX_M / z, theta=np.where(on, tilt, 0.0), azimuth=azimuth, a=a, b=b, on=on, wall=wall, time=time,
                 memory={}, lux=float(self.rng.choice([20, 200, 800, 2500, 6000])) if self.lit else None)
        sigma = eq1(z, v["theta"]) / (np.cos(v["theta"]) if self.across else 1) * PX_M / z**2
        for factor in self.factor:
            sigma = sigma * factor(v)
        sigma = np.sqrt(sigma**2 + sum(g(v) for g in self.variance))
        bias = sum(g(v) for g in self.bias)
        kept = np.ones_like(z)
        for lost in self.lost:
            kept = kept * (1 - lost(v))
        for k in range(1, 1 + round(PX_M * (1 / z0 - 1 / wall) * self.shadow)):
            kept = np.where(np.roll(on, k, axis=1) & ~on, 0, kept)
        (folder / "depth").mkdir(parents=True)
        for k in range(FRAMES):
            moved = np.where(on, z * (1 - self.velocity * k / 30 / z0), z)
            # A moving target has the noise of its current depth.
            nearer = eq1(moved, v["theta"]) / eq1(z, v["theta"]) * (z / moved) ** 2
            d = PX_M / moved + bias + sigma * nearer * self.noise(v, k)
            d = self.mixing(v, d) if self.mixing else d
            for frame in self.frame:
                d = frame(v, d)
            depth = self.depth(PX_M / np.maximum(d, 1.0))
            seen = (depth > 0.35) & (depth < 9) & (self.rng.random(z.shape) < kept)
            self.save(folder, "depth", k, time, np.where(seen, self.word(depth * UNITS), 0))
            if self.print:
                ray2 = 1 + x * x + y * y
                light = 2000 * self.print(v) * np.where(on, slope, 1) / np.sqrt(ray2) / (z * z * ray2)
                self.save(folder, "ir", k, time, light + 8 * self.rng.standard_normal(z.shape))
        notes = {"ambient_lux": v["lux"]} if self.lit else {}
        if self.reference_m:
            notes["reference_distance_m"] = float(z0 + self.rng.normal(0, self.reference_m))
        (folder / "view.json").write_text(json.dumps(notes))

    def save(self, folder, kind, k, time, image):
        (folder / kind).mkdir(exist_ok=True)
        words = np.clip(np.rint(image), 0, 65535).astype(np.uint16)
        Image.fromarray(words).save(folder / kind / f"{k}.png", compress_level=1)
        with open(folder / f"{kind}.txt", "a") as lines:
            lines.write(f"{time + k / 30:.4f} {kind}/{k}.png\n")


CAUSES = {}


def cause(make):
    CAUSES[make.__name__.replace("_", "-")] = make


def size(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng, low, high):
    return float(rng.choice([-1, 1])) * size(rng, low, high)


def simple(name, low, high, change, sign=size):
    """A cause with one parameter; `change` adds a function of the view to the sensor."""

    def make(s, rng):
        number = sign(rng, low, high)
        change(s, number)
        return number

    CAUSES[name] = make


def checks(v):
    return np.where((np.floor(v["a"] / 0.2) + np.floor(v["b"] / 0.2)) % 2 == 0, 0.35, 1.0)


def spot(s, at, width):
    u, w = s.rng.uniform(220, 420), s.rng.uniform(160, 320)
    return lambda v: at * np.exp(-((COLUMN - u) ** 2 + (ROW - w) ** 2) / 2 / width**2)


def blurred(e, length):
    e = gaussian_filter(e, length)
    return e / e.std()


def still(s, v):
    if "e" not in v["memory"]:
        v["memory"]["e"] = s.rng.standard_normal((HEIGHT, WIDTH))
    return v["memory"]["e"]


simple("clean", 1, 1, lambda s, n: None)
simple("radial-disparity-bias", 0.03, 0.3, lambda s, k: s.bias.append(lambda v: k * RADIUS**2.3), signed)
simple("pixel-locking", 0.01, 0.06, lambda s, a: s.bias.append(lambda v: a * (np.abs((v["d"] + 0.25) % 1 - 0.5) * 4 - 1)))
simple("column-banding", 0.01, 0.08, lambda s, a: s.bias.append(lambda v: a * (2 * (COLUMN % 97) / 97 - 1)))
simple("disparity-offset", 0.03, 0.3, lambda s, o: (s.bias.append(lambda v: o), setattr(s, "reference_m", 0.002)), signed)
simple("range-exponent", 0.1, 0.6, lambda s, e: s.factor.append(lambda v: (v["z"] / 1.8) ** e), signed)
simple("slope-noise", 0.3, 1.2, lambda s, l: s.variance.append(lambda v: (l * np.tan(v["theta"]) * BASELINE / v["z"]) ** 2))
simple("tilt-axis-anisotropy", 0.1, 0.7, lambda s, q: s.factor.append(
    lambda v: 1 + q * np.sin(v["theta"]) ** 1.2 * np.abs(np.cos(v["azimuth"])) ** 1.5))
simple("vignetting", 0.1, 0.8, lambda s, g: s.factor.append(lambda v: 1 + g * RADIUS**3))
simple("intensity-dependent-noise", 0.15, 0.7, lambda s, e: (
    setattr(s, "print", checks), s.factor.append(lambda v: 0.4 + 0.6 * checks(v) ** -e)))
simple("ambient-light", 5e-5, 5e-4, lambda s, q: (
    setattr(s, "lit", True), s.factor.append(lambda v: 1 + q * v["lux"] * (v["z"] / 2) ** 2 / 2)))
simple("row-noise", 0.005, 0.04, lambda s, a: s.frame.append(lambda v, d: d + a * s.rng.standard_normal((HEIGHT, 1))))
simple("frame-jitter", 0.003, 0.05, lambda s, a: s.frame.append(lambda v, d: d + a * s.rng.standard_normal()))
simple("grazing-dropout", 40, 58, lambda s, t: s.lost.append(
    lambda v: 0.45 * (1 + np.tanh((v["theta"] - np.radians(t)) / np.radians(2.5)))))
simple("range-dropout", 2.2, 3.4, lambda s, z: s.lost.append(lambda v: 1 / (1 + (z / v["z"]) ** 14)))
simple("occlusion-shadow", 0.4, 1.2, lambda s, w: setattr(s, "shadow", w))
simple("target-motion", 0.01, 0.1, lambda s, w: setattr(s, "velocity", w), signed)
simple("depth-scale", 0.004, 0.03, lambda s, q: (setattr(s, "depth", lambda z: z * (1 + q)), setattr(s, "reference_m", 0.002)), signed)
simple("range-not-depth", 1, 1, lambda s, n: setattr(s, "depth", lambda z: z * np.sqrt(1 + X * X + Y * Y)))
simple("lens-distortion", 0.004, 0.05, lambda s, k: setattr(
    s, "ray", lambda x, y: (x * (1 + k * (x * x + y * y)), y * (1 + k * (x * x + y * y)))), signed)
simple("target-bow", 0.0015, 0.012, lambda s, h: setattr(
    s, "bow", lambda a, b: h * (np.cos(np.pi * a / 1.5) - 1) * np.cos(np.pi * b / 2.5)), signed)
simple("thermal-drift", 0.004, 0.02, lambda s, r: (setattr(s, "reference_m", 0.002), s.frame.append(
    lambda v, d: d / (1 + r * (1 - 1 / (1 + v["time"] / 300))))), signed)
simple("disparity-quantisation", 0.1, 0.25, lambda s, q: s.frame.append(lambda v, d: np.rint(d / q) * q))
simple("depth-rounding", 2, 10, lambda s, q: setattr(s, "word", lambda w: np.rint(w / (5 * round(q))) * 5 * round(q)))
simple("spatial-correlation", 0.5, 2, lambda s, length: setattr(
    s, "noise", lambda v, k: blurred(s.rng.standard_normal((HEIGHT, WIDTH)), length)))
simple("frozen-noise", 0.02, 0.4, lambda s, share: setattr(
    s, "noise", lambda v, k: np.sqrt(share) * still(s, v) + np.sqrt(1 - share) * s.rng.standard_normal((HEIGHT, WIDTH))))
simple("out-seam", 0.02, 0.15, lambda s, a: s.bias.append(lambda v: a * np.tanh((COLUMN - 250) / 3)))
simple("out-rings", 0.02, 0.1, lambda s, a: s.bias.append(lambda v: a * np.sin(20 * RADIUS)))
simple("out-saddle", 0.03, 0.2, lambda s, a: s.bias.append(lambda v: 6 * a * X * Y))
simple("out-noisy-rows", 0.1, 0.5, lambda s, a: s.factor.append(lambda v: 1 + a * np.sin(2 * np.pi * ROW / 160)))
simple("out-noisy-spot", 0.2, 1.0, lambda s, a: s.factor.append(lambda v, at=spot(s, a, 60): 1 + at(v)))
simple("out-lost-spot", 0.05, 0.6, lambda s, a: s.lost.append(spot(s, a, 30)))
simple("out-late-noise", 0.1, 0.6, lambda s, a: s.factor.append(lambda v: 1 + a * (v["time"] > 400)))
simple("out-depth-wiggle", 0.003, 0.02, lambda s, a: setattr(s, "depth", lambda z: z + a * np.sin(2 * np.pi * z / 0.45)))


@cause
def fixed_pattern_noise(s, rng):
    a = size(rng, 0.01, 0.05)
    own = a * rng.standard_normal((HEIGHT, WIDTH))
    s.bias.append(lambda v: own)
    return a


@cause
def edge_mixing(s, rng):
    """Replaces disparities near the edge by their mean under a blur."""
    width = size(rng, 1.0, 3.5)

    def mixing(v, d):
        share = gaussian_filter(v["on"].astype(float), width / 2)
        board = gaussian_filter(np.where(v["on"], v["d"], 0), width / 2) / np.maximum(share, 1e-6)
        mixed = share * board + (1 - share) * PX_M / v["wall"] - v["d"]
        return np.where((share > 0.02) & (share < 0.98), d + mixed, d)

    s.mixing = mixing
    return width


@cause
def heavy_tails(s, rng):
    share = size(rng, 0.002, 0.03)

    def noise(v, k):
        far = s.rng.laplace(0, 3.5, (HEIGHT, WIDTH))
        return np.where(s.rng.random((HEIGHT, WIDTH)) < share, far, s.rng.standard_normal((HEIGHT, WIDTH)))

    s.noise = noise
    return share


@cause
def temporal_correlation(s, rng):
    rho = rng.uniform(0.1, 0.6)

    def noise(v, k):
        e, before = s.rng.standard_normal((HEIGHT, WIDTH)), v["memory"].get("e")
        v["memory"]["e"] = e if before is None else rho * before + np.sqrt(1 - rho * rho) * e
        return v["memory"]["e"]

    s.noise = noise
    return rho


def pairs(seed, count):
    """Pairs of causes that can act together: no two set the same property of the sensor."""
    rng, drawn = np.random.default_rng([seed, len(CAUSES)]), []
    named = [c for c in CAUSES if c != "clean" and not c.startswith("out-")]
    shared = {"reference_m", "print", "lit"}

    def sets(name):
        sensor = Sensor(np.random.default_rng(0), False)
        before = dict(vars(sensor))
        CAUSES[name](sensor, sensor.rng)
        return {slot for slot, value in vars(sensor).items() if value is not before[slot]} - shared

    while len(drawn) < count:
        a, b = (str(c) for c in rng.choice(named, 2, replace=False))
        if not sets(a) & sets(b):
            drawn.append(f"{a}+{b}")
    return drawn


def verdict(name, told):
    found = [f["effect"] for f in told["findings"] if f["status"] != "not-identifiable"]
    if "+" in name:
        right = [c for c in name.split("+") if c in found]
        return "wrong" if set(found) - {None, *right} else ("missed", "one", "both")[len(right)]
    if name == "clean":
        return "alarm" if found else "match"
    if name.startswith("out-"):
        return "named" if any(found) else "unexplained" if found else "missed"
    return "first" if found[:1] == [name] else "found" if name in found else "wrong" if found else "missed"


def described(told):
    """The findings, each with its share."""
    return "; ".join(f"{f['effect'] or f['status'] + ' ' + f['statistic'] + ' over ' + f['axis']} {f['share']:.3f}"
                     for f in told["findings"] if f["status"] != "not-identifiable")


def judge(args, name, n):
    known = [list(CAUSES).index(c) for c in name.split("+")]
    rng = np.random.default_rng([args.seed, *known, n])
    here = bool(rng.random() < 0.3)
    across = here and bool(rng.integers(2))
    with contextlib.ExitStack() as stack:
        kept = args.keep and pathlib.Path(args.keep) / f"{name}.{n}"
        place = pathlib.Path(kept or stack.enter_context(tempfile.TemporaryDirectory()))
        run = lambda *words: subprocess.run([args.kinoise, "--threads", "1", *words], capture_output=True, text=True)
        sensor = Sensor(rng, across)
        numbers = "+".join(f"{CAUSES[c](sensor, rng):.3g}" for c in name.split("+"))
        about = f"{numbers} ({'calibrated here' if here else 'model'}{', across the plane' if across else ''})"
        sensor.record(place / "rec")
        model = []
        if not here:
            Sensor(rng, across).record(place / "clean")
            run("calibrate", place / "clean", "-o", place / "calibrated")
            model = ["-m", place / "calibrated/model.json"]
        done = run("diagnose", place / "rec", *model, "-o", place / "out")
        if done.returncode not in (0, 1):
            return "refused", about, done.stderr.strip()[-300:]
        told = json.loads((place / "out/diagnosis.json").read_text())
    return verdict(name, told), about, described(told)


def arguments(doc):
    p = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("causes", nargs="*", metavar="CAUSE", help="all without any")
    p.add_argument("--kinoise", default="target/release/kinoise")
    p.add_argument("--repeat", type=int, default=1, help="sets of each cause")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--keep", metavar="DIR", help="keep every set in this folder")
    return p


def report(args, judge, causes=()):
    """Judges sets of the causes, prints a line each and the counts."""
    unknown = [c for name in args.causes for c in name.split("+") if c not in CAUSES]
    if unknown:
        sys.exit(f"no such cause: {', '.join(unknown)}; there are {', '.join(CAUSES)}")
    causes = causes or args.causes or list(CAUSES)
    count = collections.Counter()
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        jobs = [(c, pool.submit(judge, args, c, n)) for n in range(args.repeat) for c in causes]
        for name, job in jobs:
            how, about, words = job.result()
            kind = "clean" if name == "clean" else "outside" if name.startswith("out-") else "pair" if "+" in name else "single"
            count[f"{kind} {how}"] += 1
            print(f"{how:11} {name} {about}: {words}", flush=True)
    print(", ".join(f"{n} {what}" for what, n in sorted(count.items())))


def main():
    p = arguments(__doc__)
    p.add_argument("--pairs", type=int, help="so many sets of two causes, instead")
    args = p.parse_args()
    report(args, judge, pairs(args.seed, args.pairs or 0))


if __name__ == "__main__":
    main()
