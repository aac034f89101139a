#!/usr/bin/env python3
"""What a learnt model is worth to the map, as a CSV with one row per map.

films: real sequences with ground truth. `calibrate` and `diagnose` learn from a recording; every film is
    mapped raw with equal weights, with Eq. 1 and with the calibrated sigma, and corrected for the biases found
    with Eq. 1 and with the calibrated sigma.
seeds: for each --effect, and in the speckle simulator for each --cause (several of one sensor: joined by +;
    "none" for a sensor as it is), one simulated sensor per seed. It takes views of a wall, from which
    `calibrate` fits sigma alone and `diagnose` extends the model with the causes it finds. The same sensor
    films the office, and the film is mapped with both models. Prints how often the extended model is worse.

    map_worth.py [--kinoise BIN] --csv FILE films --recording DIR FILM...
    map_worth.py [--kinoise BIN] --csv FILE seeds [--seeds N] [--effect ID:KEY=VALUE]... [--cause NAME=VALUE]... [--frames N] [--shrink N]
"""
import argparse, csv, json, pathlib, subprocess, sys, tempfile

DISTANCES, TILTS = "1,1.5,2,3,4", "0,17,34"
# Error of the boards' reference distances, m, as of a tape measure; without any a model cannot learn a scale.
REFERENCE_ERROR_M = 0.002
# The paper's Eq. 1 over its measured range.
EQ_1 = dict(a=0.00151, b=0.00215, c=0.483, d=1.88e-6, e=2.01, f=1.39)
EQ_1_VALID = {"z_m": [1.0, 4.0], "theta_rad": [0.0, 1.38]}
METHODS = "best", "projective", "paper"
ERRORS = "ate_m", "rpe_m", "rpe_degrees", "lost"


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--kinoise", default="target/release/kinoise")
    p.add_argument("--csv", required=True, type=pathlib.Path, help="file to write")
    kinds = p.add_subparsers(dest="kind", required=True)
    films = kinds.add_parser("films")
    films.add_argument("--recording", required=True, help="of the sensor to learn")
    films.add_argument("films", nargs="+", type=pathlib.Path)
    seeds = kinds.add_parser("seeds")
    seeds.add_argument("--seeds", type=int, default=10)
    seeds.add_argument("--effect", action="append", default=[])
    seeds.add_argument("--cause", action="append", default=[])
    seeds.add_argument("--frames", type=int, default=40, help="of the film")
    seeds.add_argument("--shrink", type=int, default=2, help="of 640 x 480 px")
    return p.parse_args()


class Kinoise:
    def __init__(self, program, seed=1):
        self.begin = [program, "--quiet", "--seed", str(seed)]

    def __call__(self, *words):
        done = subprocess.run([*self.begin, *map(str, words)], capture_output=True, text=True)
        if done.returncode not in (0, 1):  # 1: something was found
            sys.exit(f"{' '.join(map(str, words))}: {done.stderr}")

    def learn(self, recording, at):
        """Returns the files of the bare and of the extended model, and the causes found."""
        bare, extended = at / "bare/model.json", at / "extended/model.json"
        self("calibrate", recording, "-o", bare.parent)
        self("diagnose", recording, "--model", bare, "-o", extended.parent)
        found = json.loads(extended.read_text()).get("effects", [])
        return bare, extended, " ".join(e["id"] for e in found) or "nothing"

    def errors(self, film, *words):
        with tempfile.TemporaryDirectory() as out:
            self("map", film, "-o", out, "--no-colour", "--force", *words)
            stats = json.loads((pathlib.Path(out) / "stats.json").read_text())
        truth = stats["truth"]
        numbers = (truth["ate"]["rmse_m"], truth["rpe_translation"]["rmse_m"], truth["rpe_rotation"]["rmse_deg"])
        return *(f"{n:.5f}" for n in numbers), stats["lost"]


def films(kinoise, a, at):
    bare, extended, found = kinoise.learn(a.recording, at)
    print(f"learnt: {found}", flush=True)
    biases = at / "eq1-with-biases.json"
    biases.write_text(json.dumps(with_eq_1(json.loads(extended.read_text()))))
    yield "film", "method", "sigma", "depth", *ERRORS
    for film in a.films:
        for method in METHODS:
            maps = [
                ("none", "raw", ["--weights", "none"]),
                ("Eq. 1", "raw", []),
                ("calibrated", "raw", ["-m", bare]),
                ("Eq. 1", "corrected", ["-m", biases]),
                ("calibrated", "corrected", ["-m", extended]),
            ]
            for sigma, depth, words in maps:
                yield film.name, method, sigma, depth, *kinoise.errors(film, "--method", method, *words)


def with_eq_1(model):
    """The same biases with the paper's sigma and independent pixels."""
    effects = [e for e in model["effects"] if e["id"] != "spatial-correlation"]
    parameters = {name: {"value": value, "std_error": None} for name, value in EQ_1.items()}
    sigma = {**model["sigma"], "form": "paper", "parameters": parameters, "valid": EQ_1_VALID}
    sigma["covariance"] = [[0.0] * len(EQ_1)] * len(EQ_1)
    return {**model, "sigma": sigma, "effects": effects}


def seeds(_, a, at):
    yield "effect", "seed", *(f"{kind}_{e}" for kind in ("bare", "extended") for e in ERRORS), "found"
    for effect in a.effect or ([] if a.cause else ["radial-disparity-bias:k_px=0.3"]):
        yield from sensors(a, at, effect, [word for part in effect.split("+") for word in ("--effect", part)])
    for cause in a.cause:
        parts = [] if cause == "none" else cause.split("+")
        world = ["--physics", "speckle", *(word for part in parts for word in ("--cause", part))]
        yield from sensors(a, at, f"light: {cause}", world)


def sensors(a, at, name, world):
    worse = [0, 0]
    for seed in range(1, a.seeds + 1):
        kinoise, here = Kinoise(a.kinoise, seed), at / f"{name}-{seed}"
        kinoise("simulate", here / "wall", "--wall-target", "--distances", DISTANCES, "--tilts", TILTS,
                "--azimuths", "0", "--frames", 2, "--reference-error", REFERENCE_ERROR_M, "--shrink", a.shrink, *world)
        bare, extended, found = kinoise.learn(here / "wall", here)
        # In the speckle simulator a model brings its sensor only; by formula it would bring its sigma too.
        sensor = ["-m", bare] if "--physics" in world else ["--shrink", a.shrink]
        kinoise("simulate", here / "film", "--room", "--frames", a.frames, *sensor, *world)
        before, after = (kinoise.errors(here / "film", "-m", model) for model in (bare, extended))
        worse = [n + (float(b) < float(e)) for n, b, e in zip(worse, before, after)]
        yield name, seed, *before, *after, found
    print(f"{name}: the extended model is worse in {worse[0]} of {a.seeds} seeds by ATE, in {worse[1]} by RPE")


def main():
    a = arguments()
    beside = a.csv.with_suffix(".part")
    with tempfile.TemporaryDirectory() as folder, beside.open("w", newline="") as out:
        table = csv.writer(out, lineterminator="\n")
        for row in {"films": films, "seeds": seeds}[a.kind](Kinoise(a.kinoise), a, pathlib.Path(folder)):
            table.writerow(row)
            out.flush()  # an interrupted run leaves its rows
            print(*row, sep="  ", flush=True)
    beside.replace(a.csv)


if __name__ == "__main__":
    main()
