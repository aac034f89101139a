#!/usr/bin/env python3
"""Sensors with white noise whose sigma obeys another formula than the fitted one.

Views of a plane are made with numpy only, with noise that differs in nothing but its sigma: Eq. 1 of the paper
along the axis, Eq. 1 across the plane, Nguyen's formula, and k z^2. `kinoise diagnose` then calibrates on
the recording and looks for causes. "Calibrate again" is a right answer, a physical name is a wrong one.
With --curved, depth is the range along the ray, as from a camera whose driver confuses the two: a wall
looks curved, which must be reported as a mismatch and not refused. With --foreign, sigma is not fitted to
the recording but to a sensor that obeys the next of these formulas.

    form_misfits.py [--kinoise BIN] [--sets N] [--seed S] [--jobs J] [--curved] [--foreign]
"""
import argparse, collections, concurrent.futures, json, pathlib, subprocess, sys, tempfile

try:
    import numpy as np
    from PIL import Image
except ImportError as missing:
    sys.exit(f"{missing}: this bench needs python3 with numpy and Pillow")

WIDTH, HEIGHT, FOCAL, UNITS = 320, 240, 290.0, 5000
DISTANCES, TILTS, FRAMES = np.arange(1.0, 4.1, 0.5), (0, 25, 45, 60, 70), 4


def eq1(z, t):
    return 0.00151 + 0.00215 * (z - 0.483) ** 2 + 1.88e-6 * z**2.01 * t**2 / (1.39 - t) ** 2


FORMS = {  # Standard deviation of depth along the axis, m.
    "Eq. 1 along the axis": eq1,
    "Eq. 1 across the plane": lambda z, t: eq1(z, t) / np.cos(t),
    "Nguyen": lambda z, t: 0.0012 + 0.0019 * (z - 0.4) ** 2 + 1e-4 / np.sqrt(z) * t**2 / (np.pi / 2 - t) ** 2,
    "k z^2": lambda z, t: 0.00285 * z**2,
}


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--kinoise", default="target/release/kinoise")
    p.add_argument("--sets", type=int, default=20, help="of each form")
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--curved", action="store_true", help="depth is the range along the ray")
    p.add_argument("--foreign", action="store_true", help="diagnose with a model of another formula")
    return p.parse_args()


def recording(folder, sigma, curved, rng):
    about = dict(format="recording/1", sensor="numpy", width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL,
                 cx=WIDTH / 2 - 0.5, cy=HEIGHT / 2 - 0.5, baseline_m=0.075, units_per_metre=UNITS)
    folder.mkdir()
    (folder / "recording.json").write_text(json.dumps(about))
    x = (np.arange(WIDTH) - about["cx"]) / FOCAL
    y = (np.arange(HEIGHT)[:, None] - about["cy"]) / FOCAL
    views = [(z, t) for z in DISTANCES for t in TILTS]
    for n, k in enumerate(rng.permutation(len(views))):
        (distance, tilt), azimuth = views[k], rng.uniform(0, 2 * np.pi)
        theta = np.radians(tilt)
        slope = np.sin(theta) * (np.cos(azimuth) * x + np.sin(azimuth) * y) + np.cos(theta)
        with np.errstate(divide="ignore"):
            z = np.where(slope > 0.05, distance * np.cos(theta) / slope, 0)
        seen = (z > 0.5) & (z < 6)
        z = np.where(seen, z, 1)
        shown = z * np.sqrt(1 + x * x + y * y) if curved else z
        view = folder / f"{n:03}"
        (view / "depth").mkdir(parents=True)
        lines = []
        for f in range(FRAMES):
            noisy = shown + sigma(z, theta) * rng.standard_normal(z.shape)
            words = np.where(seen, np.rint(noisy * UNITS), 0).astype(np.uint16)
            Image.fromarray(words).save(view / "depth" / f"{f}.png", compress_level=1)
            lines.append(f"{n + f / 30:.4f} depth/{f}.png\n")
        (view / "depth.txt").write_text("".join(lines))


def foreign_model(args, place, form, rng):
    """Calibrates a sensor that obeys the next formula; returns the model option."""
    forms = list(FORMS)
    other = forms[(forms.index(form) + 1) % len(forms)]
    recording(place / "other", FORMS[other], False, rng)
    subprocess.run([args.kinoise, "calibrate", place / "other", "-o", place / "calibrated"],
                   capture_output=True, check=True)
    return ["-m", place / "calibrated/model.json"]


def judge(args, form, n):
    rng = np.random.default_rng([args.seed, list(FORMS).index(form), n])
    with tempfile.TemporaryDirectory() as place:
        place = pathlib.Path(place)
        recording(place / "rec", FORMS[form], args.curved, rng)
        model = foreign_model(args, place, form, rng) if args.foreign else []
        run = subprocess.run([args.kinoise, "--threads", "1", "diagnose", place / "rec", *model, "-o", place / "out"],
                             capture_output=True, text=True)
        if run.returncode == 2:
            return form, n, "refused", [run.stderr.strip()[-300:]]
        told = json.loads((place / "out/diagnosis.json").read_text())
        found = [f for f in told["findings"] if f["status"] != "not-identifiable"]
        return form, n, told["verdict"], [f"{f['status']} {f['effect']} over {f['axis']}" for f in found]


def main():
    args = arguments()
    count = collections.defaultdict(collections.Counter)
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        jobs = [pool.submit(judge, args, form, n) for form in FORMS for n in range(args.sets)]
        for job in jobs:
            form, n, verdict, found = job.result()
            named = any(f.startswith(("named", "one-of")) for f in found)
            count[form].update([verdict, "sets"] + ["physics named"] * named)
            if verdict != "match":
                print(f"{form}, {n}: {verdict}: {'; '.join(found)}", flush=True)
    for form, c in count.items():
        print(f"{form:24} " + ", ".join(f"{c[k]} {k}" for k in ("sets", "match", "mismatch", "refused", "physics named")))


if __name__ == "__main__":
    main()
