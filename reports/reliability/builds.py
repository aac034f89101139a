"""The program as others build it: without optimisation, and from a clone without a network."""

import csv
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from desk import Desk, Tally

# Optimised sums are the same sums: nothing reorders them, but a fused or vectorised function of the
# mathematics library may end in another digit, which an iterated fit carries on.
SAME = 1e-6
LINES = ["simulate rec --shrink 8 --frames 3 --distances 1,1.5,2,3 --tilts 0,30,60 --effect radial-disparity-bias:k_px=1",
         "simulate film --room --shrink 8 --frames 4", "calibrate rec -o cal", "diagnose rec -o dia", "correct rec -m dia/model.json -o better",
         "map film -m cal/model.json -o map"]
# Times, and what the machine was doing.
TIMED = {"ms", "peak_rss_mb", "seconds", "cpu_seconds"}


def debug(binary, rng, times, unoptimised):
    """The same commands by both builds: the same files, and the same numbers in them."""
    tally = Tally("debug and release build: the same files and the same numbers")
    same = numbers = 0
    with Desk(binary) as fast, Desk(unoptimised) as slow:
        for line in LINES:
            # A build without optimisation takes its time.
            runs = [desk.run(line, seconds=1800, preexec_fn=None) for desk in (fast, slow)]
            wrong = [] if runs[0].code == runs[1].code else [f"exit codes {runs[0].code} and {runs[1].code}"]
            place = line.split(" -o ")[-1] if " -o " in line else line.split(" ")[1]
            names = [sorted(p.relative_to(d.at(place)) for p in d.at(place).rglob("*") if p.is_file()) for d in (fast, slow)]
            if names[0] != names[1]:
                wrong.append("other files")
            for name in names[0] if names[0] == names[1] else []:
                one, two = (d.at(place) / name for d in (fast, slow))
                if one.read_bytes() == two.read_bytes():
                    same += 1
                    continue
                differing = compared(one, two)
                numbers += 1
                wrong += [f"{place}/{name}: {d}" for d in differing]
            tally.add(runs[1].code, wrong, line)
    return [tally.row(f"{same} files of the same bytes, {numbers} whose numbers agree to {SAME:g}")]


def compared(one, two):
    """Where two files differ by more than the last digits."""
    if one.suffix == ".json":
        return differences(json.loads(one.read_text()), json.loads(two.read_text()))
    if one.suffix == ".csv":
        return differences(*([[as_number(cell) for cell in row] for row in csv.reader(p.open())] for p in (one, two)))
    if one.suffix == ".txt":
        return differences(*([[as_number(w) for w in row.split()] for row in p.read_text().splitlines()] for p in (one, two)))
    # Pages, pictures and points are made of these numbers.
    return [] if abs(one.stat().st_size - two.stat().st_size) <= 0.01 * one.stat().st_size else ["another size"]


def as_number(word):
    try:
        return float(word)
    except ValueError:
        return word


def differences(one, two, key=""):
    if isinstance(one, dict) and isinstance(two, dict):
        if one.keys() != two.keys():
            return [f"{key}: other keys"]
        return [d for k in one if k not in TIMED for d in differences(one[k], two[k], f"{key}.{k}")]
    if isinstance(one, list) and isinstance(two, list):
        if len(one) != len(two):
            return [f"{key}: {len(one)} and {len(two)} entries"]
        return [d for k, (a, b) in enumerate(zip(one, two)) for d in differences(a, b, f"{key}[{k}]")]
    if isinstance(one, (int, float)) and isinstance(two, (int, float)):
        return [] if abs(one - two) <= SAME * max(abs(one), abs(two), 1e-6) else [f"{key}: {one} and {two}"]
    return [] if one == two else [f"{key}: {str(one)[:60]} and {str(two)[:60]}"]


def clone(binary, rng, times):
    """A bare clone of the repository, one fetch, and a check without a network."""
    tally = Tally("a clone builds with --locked --offline after one cargo fetch")
    source = Path(__file__).resolve().parents[2]
    with tempfile.TemporaryDirectory(prefix="kinoise-clone-") as folder:
        bare, tree = Path(folder) / "bare.git", Path(folder) / "tree"
        steps = [["git", "clone", "-q", "--bare", str(source), str(bare)], ["git", "clone", "-q", str(bare), str(tree)],
                 ["cargo", "fetch", "--locked"], ["cargo", "check", "--release", "--locked", "--offline"]]
        for step in steps:
            if step[-1] == "--offline" and shutil.which("unshare"):
                # Without a network for sure, where that may be had.
                probe = subprocess.run(["unshare", "-rn", "true"], capture_output=True, check=False)
                step = ["unshare", "-rn", *step] if probe.returncode == 0 else step
            ran = subprocess.run(step, cwd=tree if tree.exists() else folder, env=os.environ, capture_output=True, text=True, check=False)
            tally.add(0 if ran.returncode == 0 else ran.returncode, [] if ran.returncode == 0 else [ran.stderr[-400:]], " ".join(step))
    return [tally.row()]
