#!/usr/bin/env python3
"""What a learnt model is worth to the map: film and plane views of one simulated sensor, seed after seed.

A sensor with the given effects takes views of a wall; `calibrate` fits sigma alone and `diagnose` extends
the model with the causes it finds. The same sensor films the office, and the film is mapped with both.
Prints a row a seed (ATE and RPE over 1 s, m) and how often the extended model is the worse one.

    map_worth.py [--kinoise BIN] [--seeds N] [--effect ID:KEY=VALUE]... [--frames N] [--shrink N]
"""
import argparse, json, pathlib, subprocess, sys, tempfile

DISTANCES, TILTS = "1,1.5,2,3,4", "0,17,34"


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("--kinoise", default="target/release/kinoise")
    p.add_argument("--seeds", type=int, default=10)
    p.add_argument("--effect", action="append", default=[])
    p.add_argument("--frames", type=int, default=40, help="of the film")
    p.add_argument("--shrink", type=int, default=2, help="of 640 x 480 px")
    return p.parse_args()


def main():
    a = arguments()
    causes = [word for effect in a.effect or ["radial-disparity-bias:k_px=0.3"] for word in ("--effect", effect)]

    def kinoise(seed, *words):
        done = subprocess.run([a.kinoise, "--seed", str(seed), *map(str, words)], capture_output=True, text=True)
        if done.returncode not in (0, 1):  # 1: something was found
            sys.exit(done.stderr)

    def errors(seed, film, model, out):
        kinoise(seed, "map", film, "-m", model, "-o", out, "--no-colour")
        truth = json.loads((out / "stats.json").read_text())["truth"]
        return truth["ate"]["rmse_m"], truth["rpe_translation"]["rmse_m"]

    print("seed  bare: ATE     RPE  extended: ATE     RPE  found", flush=True)
    worse = [0, 0]
    for seed in range(1, a.seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            at = pathlib.Path(folder)
            small = ["--shrink", a.shrink, *causes]
            kinoise(seed, "simulate", at / "wall", "--wall-target", "--distances", DISTANCES, "--tilts", TILTS,
                    "--azimuths", "0", "--frames", 2, *small)
            kinoise(seed, "simulate", at / "film", "--room", "--frames", a.frames, *small)
            kinoise(seed, "calibrate", at / "wall", "-o", at / "bare")
            kinoise(seed, "diagnose", at / "wall", "--model", at / "bare/model.json", "-o", at / "extended")
            bare = errors(seed, at / "film", at / "bare/model.json", at / "map-bare")
            extended = errors(seed, at / "film", at / "extended/model.json", at / "map-extended")
            found = json.loads((at / "extended/model.json").read_text()).get("effects", [])
            names = ", ".join(e["id"] for e in found) or "nothing"
            print(f"{seed:4}  {bare[0]:9.4f} {bare[1]:7.4f}  {extended[0]:13.4f} {extended[1]:7.4f}  {names}", flush=True)
            worse = [n + (e > b) for n, e, b in zip(worse, extended, bare)]
    print(f"the extended model is worse in {worse[0]} of {a.seeds} seeds by ATE, in {worse[1]} by RPE")


if __name__ == "__main__":
    main()
