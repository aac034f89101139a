"""Inputs of every kind with something wrong in them, given to every command that reads them."""

import json
import os
import random
import re
import shutil
import struct
import subprocess
import tempfile
from pathlib import Path

from desk import Desk, Tally, complaints
from mutations import mutate, mutated_number

CONTAINERS = Path(__file__).parents[2] / "tests/data/containers"
CAMERA = "--intrinsics 72.5,72.5,39.5,29.5 --units-per-metre 5000"
SMALL = "--intrinsics 29,29.25,15.5,11.75 --units-per-metre 1000"
NAMES = {"rec": "recording", "film": "film (TUM)", "scenes": "film (7-Scenes)", "dump": "fakenect dump", "images": "folder of PNGs",
         "film3": "film.db3", "truth.txt": "trajectory"}
FORMATS = ["python", "c", "npz", "opencv", "camera-info", "elevation-mapping", "isaac", "clams", "open3d"]

# Of every kind of input, the commands that read it; IN is the spoilt copy, OUT the result. The sizes
# are such that most runs take a tenth of a second.
COMMANDS = {
    "rec": ["calibrate IN -o OUT --sigma temporal --json", "metrics IN -o OUT --json", "metrics IN", "metrics IN --json", "correct IN -m model.json -o OUT",
            "correct IN -m model.json -o OUT --sigma sigma", "simulate OUT --like IN", "diagnose IN -o OUT",
            "capture OUT --source play:IN --plain --views any --frames 2 --hold 1 --force"],
    "model.json": ["correct rec -m IN -o OUT", "sigma film -m IN -o OUT", "map film -m IN --block 1 -o OUT", "units IN base.json --json",
                   "simulate OUT -m IN --frames 1 --distances 1,2 --tilts 0,40", "diagnose rec -m IN -o OUT",
                   *[f"export IN --format {f} -o OUT" for f in FORMATS]],
    "diagnosis.json": ["capture OUT --source play:rec --plain --frames 2 --hold 1 --force --advise IN"],
    "table.csv": ["fit IN -o OUT --json"],
    "truth.txt": ["evaluate --truth IN --estimate truth.txt --delta-unit f --json", "evaluate --truth truth.txt --estimate IN --delta-unit f --json",
                  "evaluate --truth truth.txt --estimate IN --delta-unit f -o OUT", "evaluate --truth IN --estimate truth.txt --delta-unit f --offset auto",
                  "simulate OUT --room --trajectory IN --frames 2 --shrink 8"],
    "film": ["map IN --block 1 -o OUT", "sigma IN -m model.json -o OUT", "map IN -o OUT --method paper --json", "correct IN -m model.json -o OUT"],
    "scenes": [f"map IN --block 1 -o OUT {CAMERA}", f"sigma IN -m model.json -o OUT {CAMERA}"],
    "dump": ["metrics IN --json", "metrics IN"],
    "images": [f"metrics IN --json {CAMERA}", f"correct IN -m model.json -o OUT {CAMERA}"],
    **{name: [f"metrics IN --json {SMALL}", f"sigma IN -m film-model.json -o OUT {SMALL}", f"correct IN -m film-model.json -o OUT {SMALL}"]
       for name in ["film.bag", "film.mcap", "film.npz", "realsense.bag", "unindexed.mcap", "metres.npy", "film3"]},
}


def materials(desk):
    """Inputs that nothing is wrong with."""
    desk.made("simulate rec --shrink 8 --frames 2 --distances 1,1.5,2,3 --tilts 0,40 --conditions --infrared")
    desk.made("calibrate rec -o cal")
    shutil.copy(desk.at("cal/model.json"), desk.at("base.json"))
    bowl = json.loads(desk.at("base.json").read_text())
    desk.made("simulate bent --shrink 8 --frames 4 --distances 1,1.5,2,2.5,3 --tilts 0,20,40 --effect radial-disparity-bias:k_px=0.2")
    desk.made("diagnose bent -o dia")
    bent = json.loads(desk.at("dia/model.json").read_text())
    bent["sensor"] = bowl["sensor"]
    desk.at("model.json").write_text(json.dumps(bent, indent=2))
    found = json.loads(desk.at("dia/diagnosis.json").read_text())
    found["findings"][0]["next_view"] = {"z_m": 1.5, "theta_rad": 0.35, "azimuth_rad": 0.0, "why": "to see more"}
    desk.at("diagnosis.json").write_text(json.dumps(found, indent=2))
    shutil.copy(desk.at("cal/measurements.csv"), desk.at("table.csv"))
    desk.made("simulate film --room --shrink 8 --frames 6")
    shutil.copy(desk.at("film/groundtruth.txt"), desk.at("truth.txt"))
    for name in ["scenes", "images"]:
        desk.at(name).mkdir()
    for k, image in enumerate(sorted(desk.at("film/depth").iterdir())):
        shutil.copy(image, desk.at(f"scenes/frame-{k:06}.depth.png"))
        turn = f"1 0 0 {0.01 * k}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
        desk.at(f"scenes/frame-{k:06}.pose.txt").write_text(turn)
    for k, image in enumerate(sorted(desk.at("rec").glob("*/depth/0000.png"))):
        shutil.copy(image, desk.at(f"images/{k:04}.png"))
    dump(desk.at("dump"))
    for container in CONTAINERS.iterdir():
        if container.is_file():
            shutil.copy(container, desk.at(container.name))
        else:
            shutil.copytree(container, desk.at("film3"))
    desk.made(f"calibrate film.bag -o film-cal {SMALL} --force")
    shutil.copy(desk.at("film-cal/model.json"), desk.at("film-model.json"))


def dump(folder):
    """A fakenect dump of a wall: 11-bit words, 640 x 480."""
    folder.mkdir()
    rng, index = random.Random(1), []
    for view, word in enumerate([640, 760]):
        for k in range(4):
            stamp = f"{100 * view + 0.1 * k:.6f}"
            name = f"d-{stamp}-{1000 + 10 * k}.pgm"
            words = [word + rng.choice((0, 0, 0, 1)) for _ in range(64)] * (640 * 480 // 64)
            (folder / name).write_bytes(b"P5 640 480 65535\n" + struct.pack(f"<{len(words)}H", *words))
            index.append(name)
    (folder / "INDEX.txt").write_text("\n".join(index) + "\n")


def spoilt_files(rng, path):
    """What of an input to spoil: lists and descriptions as often as all images together."""
    if path.is_file():
        return [path]
    images = [p for p in path.rglob("*") if p.suffix in (".png", ".pgm")]
    others = [p for p in path.rglob("*") if p.is_file() and p.suffix not in (".png", ".pgm")]
    group = images if images and (not others or rng.random() < 0.4) else others
    return [rng.choice(group)]


def spoilt_inputs(binary, rng, times):
    """A row a kind of input."""
    rows = []
    with Desk(binary) as desk:
        materials(desk)
        kinds = list(COMMANDS)
        for kind in kinds:
            tally = Tally(f"spoilt input: {NAMES.get(kind, kind)}")
            for _ in range(max(1, times // len(kinds))):
                suffix = Path(kind).suffix
                desk.copy(kind, "spoilt" + suffix)
                done = [f"{p.name} {mutate(rng, p)}" for p in spoilt_files(rng, desk.at("spoilt" + suffix))]
                commands = COMMANDS[kind]
                line = rng.choice(commands)
                if line.startswith(("calibrate", "diagnose", "fit")) and rng.random() < 0.7:
                    line = rng.choice(commands)  # these take ten times as long as the rest
                line = line.replace("IN", "spoilt" + suffix).replace("OUT", "out")
                ran = desk.run(f"{line} --threads {rng.choice([1, 2])}")
                left = [f"{p} is left" for p in desk.unfinished()]
                wrong = complaints(ran, desk.at("out") if "out" in line.split(" ") else None, desk.at("spoilt" + suffix)) + left
                if wrong:
                    desk.keep("spoilt" + suffix, f"{tally.runs}-{kind}")
                tally.add(ran.code, wrong, f"{line} ({'; '.join(done)})")
                desk.remove("out")
                desk.tidy()
            rows.append(tally.row())
            desk.remove("spoilt" + suffix)
    with Desk(binary) as desk:
        materials(desk)
        rows.append(odd_words(desk, rng, max(1, times // len(kinds))))
    return rows


def odd_words(desk, rng, times):
    """Command lines with numbers, names and bytes that nobody means."""
    tally = Tally("odd command lines")
    os.mkfifo(desk.at("pipe"))
    with Stock(desk) as stock:
        odd_lines(desk, stock, tally, rng, times)
    return tally.row()


class Stock:
    """The inputs again, after a command that was told to write over them."""

    def __init__(self, desk):
        self.desk, self.copy = desk, tempfile.mkdtemp(prefix="kinoise-stock-")
        shutil.rmtree(self.copy)
        subprocess.run(["cp", "-a", desk.root, self.copy], check=True)
        self.state = self.seen()

    def seen(self):
        return {(p, p.lstat().st_size, p.lstat().st_mtime_ns) for p in self.desk.root.rglob("*") if not p.is_dir()}

    def restore(self):
        if self.seen() != self.state:
            shutil.rmtree(self.desk.root)
            subprocess.run(["cp", "-a", self.copy, self.desk.root], check=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        shutil.rmtree(self.copy)


def odd_lines(desk, stock, tally, rng, times):
    lines = [l.replace("IN", k).replace("OUT", "out") for k, ls in COMMANDS.items() for l in ls]
    lines += ["simulate out --shrink 8 --frames 1 --distances 1,2 --tilts 0,40 --effect vignetting:growth=0.5 --seed 3",
              "simulate out --room --frames 2 --shrink 8 --stride 2", "effects vignetting --json", "schema model",
              "evaluate --truth truth.txt --estimate truth.txt --delta 1 --offset auto", "man out"]
    for _ in range(times):
        words = rng.choice(lines).split(" ")
        for _ in range(rng.choice([1, 1, 2])):
            i = rng.randrange(len(words))
            kind = rng.randrange(4)
            if kind == 0 and len(words) > 1:
                words.pop(i)
            elif kind == 1:
                words.insert(i, rng.choice(["--force", "--json", "-q", "-v", "--", "-", "", "--seed", "x" * 5000]))
            elif kind == 2 and re.search(r"\d", words[i]):
                words[i] = mutated_number(rng, words[i].encode()).decode().replace("\x00", "")
            else:
                words[i] = rng.choice(["-1", "1e308", "nan", "\udcff", "a\nb", "rec", "film", "pipe", ".", "0"])
        if "demo" in words:
            continue
        ran = desk.run(words)
        wrong = complaints(ran) + [f"{p} is left" for p in desk.unfinished()]
        tally.add(ran.code, wrong, repr(words))
        stock.restore()
