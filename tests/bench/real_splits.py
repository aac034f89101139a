#!/usr/bin/env python3
"""What a correction learnt from some views of a real sensor is worth on its other views.

Splits a recording of planes into halves and into fifths (copies in a scratch folder), runs
`kinoise diagnose` on one part and `kinoise correct` with its model on the other, and measures
the root mean square around each view's plane, over pixels, in steps of the raw code.
For comparison, a page of numpy fits two smooth maps over the image to the same views, one of them
times the square of the disparity.

    real_splits.py RECORDING [--kinoise BIN] [--halves N] [--folds K] [--seed S] [--jobs J]
    real_splits.py FOLDER_OF_PNGS --intrinsics FX FY CX CY --disparity OFFSET SLOPE --views NAME ...
"""
import argparse, concurrent.futures, json, pathlib, shutil, subprocess, sys, tempfile

try:
    import numpy as np
    from PIL import Image, ImageDraw
except ImportError as missing:
    sys.exit(f"{missing}: this bench needs python3 with numpy and Pillow")

STEP = 6  # One pixel in 36 is used.
ACROSS, DOWN = 20, 15  # Splines of a map.
SMOOTH, RIDGE = 3.0, 0.3  # Penalties on the maps' second differences and values, in raw units and pixels.
BASELINE_M = 0.075


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("recording", type=pathlib.Path)
    p.add_argument("--kinoise", default="target/release/kinoise", help="the binary; 'none': numpy alone")
    p.add_argument("--halves", type=int, default=5, help="random halves, both ways each")
    p.add_argument("--folds", type=int, default=5)
    p.add_argument("--seed", type=int, default=0)
    p.add_argument("--jobs", type=int, default=1)
    p.add_argument("--threads", type=int, default=1)
    p.add_argument("--intrinsics", type=float, nargs=4)
    p.add_argument("--disparity", type=float, nargs=2, help="offset and slope of 1/z over the raw value")
    p.add_argument("--views", nargs="*", help="begin with one of these; all, if none is given")
    p.add_argument("--keep", type=pathlib.Path, help="folder for what the binary writes")
    return p.parse_args()


def as_recording(args, folder):
    """Makes a recording of a plain folder of PNGs, by links."""
    fx, fy, cx, cy = args.intrinsics
    files = sorted(args.recording.glob("*.png"))
    width, height = Image.open(files[0]).size
    code = {"offset": args.disparity[0], "slope": args.disparity[1], "invalid": 2047}
    about = dict(format="recording/1", sensor="real", width=width, height=height, fx=fx, fy=fy,
                 cx=cx, cy=cy, baseline_m=BASELINE_M, raw_disparity=code)
    folder.mkdir()
    (folder / "recording.json").write_text(json.dumps(about))
    for n, file in enumerate(files):
        view = folder / file.stem
        (view / "depth").mkdir(parents=True)
        (view / "depth" / file.name).symlink_to(file.resolve())
        (view / "depth.txt").write_text(f"{float(n):.1f} depth/{file.name}\n")
    return folder


def depth_file(view):
    return sorted((view / "depth").glob("*.png"))[0]


class View:
    """Pixels of a target with the plane through them, in raw units."""

    def __init__(self, folder, about):
        self.name, w, h = folder.name, about["width"], about["height"]
        raw = np.array(Image.open(depth_file(folder))).astype(float)
        notes = folder / "view.json"
        notes = json.loads(notes.read_text()) if notes.exists() else {}
        mask = Image.new("1", (w, h), 0 if "polygon" in notes else 1)
        if "polygon" in notes:
            ImageDraw.Draw(mask).polygon([tuple(p) for p in notes["polygon"]], fill=1)
        v, u = np.nonzero(np.array(mask) & (raw != about["raw_disparity"]["invalid"]))
        d = raw[v, u]
        x = np.stack([np.ones(len(d)), (u - about["cx"]) / about["fx"], (v - about["cy"]) / about["fy"]], 1)
        weight, s = np.ones(len(d)), 1.0
        for _ in range(30):  # Cauchy weights.
            b = np.linalg.lstsq(x * weight[:, None], d * weight, rcond=None)[0]
            r = d - x @ b
            s = max(1.4826 * np.median(np.abs(r - np.median(r))), 0.5)
            weight = np.sqrt(1 / (1 + (r / (3 * s)) ** 2))
        keep = (np.abs(r) < 6 * max(s, 1)) & (u % STEP == STEP // 2) & (v % STEP == STEP // 2)
        self.u, self.v, self.d, self.x, self.plane = u[keep], v[keep], d[keep], x[keep], (x @ b)[keep]

    def square(self, d):
        """Sum of squares around the plane, and the number of pixels."""
        ok = np.isfinite(d)
        r = d[ok] - self.x[ok] @ np.linalg.lstsq(self.x[ok], d[ok], rcond=None)[0]
        return np.array([(r**2).sum(), ok.sum()])

    def corrected(self, folder, code):
        """What `correct` wrote for this view, in the raw units of the input."""
        about = json.loads((folder / "recording.json").read_text())
        word = np.array(Image.open(depth_file(folder / self.name))).astype(float)[self.v, self.u]
        if "raw_disparity" in about:
            return np.where(word == code["invalid"], np.nan, word)
        z = np.where(word == about["invalid"], np.nan, word / about["units_per_metre"])
        return (1 / z - code["offset"]) / code["slope"]


class Page:
    """The correction by a page of numpy."""

    def __init__(self, views, about):
        code, fb = about["raw_disparity"], about["fx"] * about.get("baseline_m", BASELINE_M)
        self.size, self.columns, self.evidence = (about["width"], about["height"]), {}, {}
        for view in views:
            far = fb * (code["offset"] + code["slope"] * view.plane) / 40
            maps = self.splines(view.u, view.v)
            g = np.hstack([maps, maps * (far**2)[:, None]])
            q = np.linalg.qr(view.x)[0]
            flat, d = g - q @ (q.T @ g), view.d - q @ (q.T @ view.d)
            self.columns[view.name] = g
            self.evidence[view.name] = flat.T @ flat, flat.T @ d
        bend = lambda n: np.diff(np.eye(n), 2, axis=0).T @ np.diff(np.eye(n), 2, axis=0)
        rough = np.kron(np.eye(DOWN), bend(ACROSS)) + np.kron(bend(DOWN), np.eye(ACROSS))
        self.penalty = np.kron(np.eye(2), SMOOTH * rough + RIDGE * np.eye(ACROSS * DOWN))

    def splines(self, u, v):
        def one(at, nodes, length):
            t = at / (length - 1) * (nodes - 3)
            k = np.minimum(t.astype(int), nodes - 4)
            f = t - k
            w = [(1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3]
            row = np.zeros((len(at), nodes))
            for j, weight in enumerate(w):
                row[np.arange(len(at)), k + j] = weight / 6
            return row

        a, b = one(u, ACROSS, self.size[0]), one(v, DOWN, self.size[1])
        return (b[:, :, None] * a[:, None, :]).reshape(len(u), -1)

    def judge(self, taught, judged):
        a = self.penalty + sum(self.evidence[w.name][0] for w in taught)
        beta = np.linalg.solve(a, sum(self.evidence[w.name][1] for w in taught))
        return [w.square(w.d - self.columns[w.name] @ beta) for w in judged]


def copies(recording, views, folder):
    """A recording of some of the views, as copies: `correct` refuses links that lead out of it."""
    folder.mkdir(parents=True)
    shutil.copy(recording / "recording.json", folder)
    for view in views:
        shutil.copytree(recording / view.name, folder / view.name)
    return folder


def run(binary, *words):
    done = subprocess.run([binary, *map(str, words)], capture_output=True, text=True)
    if done.returncode > ("diagnose" in words):
        raise RuntimeError(f"{' '.join(map(str, words))}:\n{done.stderr}")
    return done


def rms(squares):
    total = sum(squares)
    return float(np.sqrt(total[0] / max(total[1], 1)))


def split(args, recording, about, page, name, taught, judged, work):
    """One row: no correction, the page of numpy, kinoise; and the names found."""
    row = {"split": name, "nothing": [w.square(w.d) for w in judged], "page": page.judge(taught, judged)}
    if args.kinoise == "none":
        return row
    here, out = work / name, work / name / "diagnosis"
    part, rest = copies(recording, taught, here / "taught"), copies(recording, judged, here / "judged")
    try:
        run(args.kinoise, "--threads", args.threads, "diagnose", part, "-o", out)
        run(args.kinoise, "--threads", args.threads, "correct", rest, "--model", out / "model.json", "-o", here / "corrected")
    except RuntimeError as why:
        row["failed"] = str(why)
        return row
    row["kinoise"] = [w.square(w.corrected(here / "corrected", about["raw_disparity"])) for w in judged]
    found = json.loads((out / "diagnosis.json").read_text())
    row["heldout"] = found.get("heldout") or {}
    row["names"] = [f["effect"] or f"({f['statistic']}, {f['axis']})" for f in found["findings"] if f["status"] != "not-identifiable"]
    bows = [f["parameters"] for f in found["findings"] if f["effect"] == "target-bow"]
    row["bow_mm"] = [1e3 * b["sagitta_m"]["value"] for b in bows if "sagitta_m" in b]
    return row


def main():
    args = arguments()
    with tempfile.TemporaryDirectory() as scratch:
        work = args.keep or pathlib.Path(scratch)
        work.mkdir(parents=True, exist_ok=True)
        recording = as_recording(args, work / "recording") if args.intrinsics else args.recording
        about = json.loads((recording / "recording.json").read_text())
        if "raw_disparity" not in about:
            sys.exit("the recording is not of raw disparities: its steps are no unit to measure by")
        folders = sorted(f for f in recording.iterdir() if (f / "depth").is_dir())
        folders = [f for f in folders if not args.views or f.name.startswith(tuple(args.views))]
        views = [View(f, about) for f in folders]
        page, rng = Page(views, about), np.random.default_rng(args.seed)
        pick = lambda which: [views[i] for i in sorted(which)]
        todo, n = [], len(views)
        for k in range(args.halves):
            p = rng.permutation(n)
            todo += [(f"half{k}{s}", pick(t), pick(j)) for s, t, j in (("a", p[: n // 2], p[n // 2 :]), ("b", p[n // 2 :], p[: n // 2]))]
        p = rng.permutation(n)
        for k in range(args.folds):
            todo.append((f"fold{k}", pick(np.setdiff1d(p, p[k :: args.folds])), pick(p[k :: args.folds])))
        one = lambda t: split(args, recording, about, page, *t, work)
        rows = []
        with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
            for row in pool.map(one, todo):
                rows.append(row)
                figures = "  ".join(f"{k} {rms(row[k]):.3f}" for k in ("nothing", "page", "kinoise") if k in row)
                print(f"{row['split']:8} {figures}  bow {row.get('bow_mm', '')} {', '.join(row.get('names', []))}{row.get('failed', '')}", flush=True)
        for what in ("nothing", "page", "kinoise"):
            halves = [rms(r[what]) for r in rows if r["split"].startswith("half") and what in r]
            folds = [s for r in rows if r["split"].startswith("fold") and what in r for s in r[what]]
            said = f"halves: median {np.median(halves):.3f}, worst {max(halves):.3f}" if halves else ""
            print(f"{what:8} {said}" + (f"; {args.folds}-fold {rms(folds):.3f}" if folds else ""))
        worse = [r["split"] for r in rows if "kinoise" in r and rms(r["kinoise"]) > rms(r["nothing"])]
        print("worse than no correction:", ", ".join(worse) or "never")


if __name__ == "__main__":
    main()
