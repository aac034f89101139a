#!/usr/bin/env python3
"""Independent concealed sets of a Kinect's kind, each held against a simulation of the same sensor.

The causes are those of foreign_sets.py. Here words are raw disparities in steps of an eighth of a pixel, noise
passes a box of 3 to 9 px, up to half of it is the same in all frames of a view, and a second recording of the
same poses, without the cause, takes the place of a model. What a matcher's light and blur may bring about too has
no name there: it "resembles" the cause at best.

    foreign_pairs.py [--kinoise BIN] [--repeat N] [--seed S] [--jobs J] [--keep DIR] [CAUSE ...]
"""
import contextlib, json, pathlib, subprocess, tempfile

from foreign_sets import BASELINE, CAUSES, EVERY_S, FOCAL, HEIGHT, UNITS, VIEWS, WIDTH, Sensor
from foreign_sets import arguments, described, np, report, verdict
from scipy.ndimage import uniform_filter

OFFSET, SLOPE, INVALID = 3.3309495161, -0.0030711016, 2047  # ROS wiki, kinect_node: 1/m and 1/m a word


class Kinect(Sensor):
    def __init__(self, rng, frozen, window):
        super().__init__(rng, False)
        self.frozen, self.window, self.noise, self.changing = frozen, window, self.partly_frozen, None

    def through_window(self, e):
        passed = uniform_filter(e, self.window)
        return passed * e.std() / passed.std()

    def partly_frozen(self, v, k):
        draw = lambda: self.through_window(self.rng.standard_normal((HEIGHT, WIDTH)))
        if "frozen" not in v["memory"]:
            v["memory"]["frozen"] = draw()
        own = self.through_window(self.changing(v, k)) if self.changing else draw()
        return np.sqrt(self.frozen) * v["memory"]["frozen"] + np.sqrt(1 - self.frozen) * own

    def record(self, folder, poses):
        folder.mkdir(parents=True)
        code = dict(offset=OFFSET, slope=SLOPE, invalid=INVALID)
        about = dict(format="recording/1", sensor="Kinect", width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL,
                     cx=(WIDTH - 1) / 2, cy=(HEIGHT - 1) / 2, baseline_m=BASELINE, raw_disparity=code)
        (folder / "recording.json").write_text(json.dumps(about))
        for n, pose in enumerate(poses):
            self.view(folder / f"{n:03}", *pose, n * EVERY_S)

    def save(self, folder, kind, k, time, image):
        if kind == "depth":
            word = np.rint((UNITS / np.maximum(image, 1) - OFFSET) / SLOPE)
            image = np.where((image > 0) & (word >= 0) & (word < INVALID), word, INVALID)
        super().save(folder, kind, k, time, image)


def judge(args, name, n):
    rng = np.random.default_rng([args.seed, list(CAUSES).index(name), n])
    frozen, window = float(rng.choice([0, 0.2, 0.5])), int(rng.choice([3, 5, 9]))
    distances = np.geomspace(0.9, 3.6, VIEWS) * rng.uniform(0.95, 1.05, VIEWS)
    tilts = np.radians(np.linspace(0, 60, VIEWS))
    rng.shuffle(distances), rng.shuffle(tilts)
    poses = list(zip(distances, tilts, rng.uniform(0, 2 * np.pi, VIEWS)))
    with contextlib.ExitStack() as stack:
        kept = args.keep and pathlib.Path(args.keep) / f"{name}.{n}"
        place = pathlib.Path(kept or stack.enter_context(tempfile.TemporaryDirectory()))
        real, simulated = Kinect(rng, frozen, window), Kinect(rng, frozen, window)
        about = f"{CAUSES[name](real, rng):.3g} (frozen {frozen}, window {window})"
        if real.noise != real.partly_frozen:  # Noise of the cause's own joins the frozen part.
            real.changing, real.noise = real.noise, real.partly_frozen
        simulated.print, simulated.lit, simulated.reference_m = real.print, real.lit, real.reference_m
        real.record(place / "rec", poses)
        simulated.record(place / "sim", poses)
        words = ["diagnose", place / "rec", "--against", place / "sim", "-o", place / "out"]
        done = subprocess.run([args.kinoise, "--threads", "1", *words], capture_output=True, text=True)
        if done.returncode not in (0, 1):
            return "refused", about, done.stderr.strip()[-300:]
        told = json.loads((place / "out/diagnosis.json").read_text())
    found = [f for f in told["findings"] if f["status"] != "not-identifiable"]
    resembles = found and found[0]["effect"] is None and [a["effect"] for a in found[0]["alternatives"][:1]] == [name]
    return "resembles" if resembles else verdict(name, told), about, described(told)


if __name__ == "__main__":
    report(arguments(__doc__).parse_args(), judge)
