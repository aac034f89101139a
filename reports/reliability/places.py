"""Every command with results in odd places, and with inputs that hold nothing, too much, or odd names."""

import os
import shutil
import subprocess
from pathlib import Path

from desk import Desk, Tally, complaints, tree
from spoilt import CAMERA, FORMATS, materials

# IN is replaced by odd inputs, OUT by odd places.
COMMANDS = [
    "calibrate IN -o OUT", f"calibrate IN -o OUT {CAMERA}", "fit IN -o OUT", "metrics IN", "metrics IN -o OUT", f"metrics IN -o OUT --json {CAMERA}",
    "diagnose IN -o OUT", "diagnose IN -m model.json -o OUT", "diagnose rec --against IN -o OUT", "correct IN -m model.json -o OUT",
    f"correct IN -m model.json -o OUT {CAMERA}", "correct rec -m IN -o OUT", "correct rec -m model.json -o out --sigma OUT", "sigma IN -m model.json -o OUT",
    "map IN -o OUT", "map IN --block 1 -o OUT --method paper", "map film -m IN --block 1 -o OUT", f"map IN --block 1 -o OUT {CAMERA}",
    "compare IN -o OUT --frames 3", "compare IN -o OUT", "evaluate --truth IN --estimate truth.txt --delta-unit f", "evaluate --truth film --estimate IN -o OUT --delta-unit f",
    "units IN model.json", "units IN", *[f"export IN --format {f} -o OUT" for f in FORMATS], "simulate OUT --like IN", "simulate OUT -m IN --shrink 8 --frames 1 --distances 1 --tilts 0",
    "simulate OUT --room --trajectory IN --frames 2 --shrink 8", "simulate OUT --shrink 8 --frames 1 --distances 1,2 --tilts 0", "man OUT", "effects IN",
    "capture OUT --source play:IN --plain --views any --frames 2 --hold 1 --patience 1", "capture OUT --source folder:IN --plain --views any --frames 2 --hold 1 --patience 1",
    "capture OUT --source play:rec --plain --frames 2 --hold 1 --patience 1 --advise IN",
]
# What each command is meant for, by a word of its line.
MEANT = {"-m IN": "model.json", "--trajectory": "truth.txt", "--advise": "diagnosis.json", "folder:IN": "images", "fit": "table.csv", "sigma": "film", "map": "film", "compare": "film",
         "--truth": "film", "units": "base.json", "export": "model.json", "effects": "vignetting"}
GOOD = ["rec", "film", "scenes", "dump", "images", "model.json", "base.json", "table.csv", "truth.txt", "diagnosis.json", "cal", "dia", "film.bag", "film.mcap", "film.npz", "metres.npy"]
LONG = "x" * 255


def odd_inputs(desk):
    """By name; those in folders of their own are made here."""
    at = desk.at
    for name in ["hollow", "folders/a/b/c", "hidden/.a"]:
        at(name).mkdir(parents=True)
    for name, data in [("empty", b""), ("empty.json", b""), ("empty.csv", b""), ("empty.bag", b""), ("empty.npy", b""), ("empty.npz", b""), ("empty.mcap", b""), ("empty.db3", b""),
                       ("zeros.json", b"\0" * 4096), ("deep.json", b"[" * 200_000), ("deeper.json", b'{"format":' * 100_000), ("mark.json", b"\xef\xbb\xbf{}"),
                       ("wide.csv", b"z_m,theta_rad,sigma_m\n" + b"," * 2_000_000), ("lines.txt", b"1 0 0 0 0 0 0 1\n" * 300_000), ("newlines.txt", b"\n" * 3_000_000),
                       ("one.txt", b"1 " * 2_000_000), ("utf16.json", '{"format": "kinoise-model/1"}'.encode("utf-16")), ("crlf.txt", at("truth.txt").read_bytes().replace(b"\n", b"\r\n")),
                       ("crlf.csv", at("table.csv").read_bytes().replace(b"\n", b"\r\n")), ("old-mac.csv", at("table.csv").read_bytes().replace(b"\n", b"\r"))]:
        at(name).write_bytes(data)
    odd = ["räume 深度 😀", "-dash", "a\nb", "it's \"quoted\" & <b>", "%s%n$(id)", " ", "tail.", LONG]
    for name in odd:
        shutil.copytree(at("rec"), at(name))
    shutil.copy(at("model.json"), at("模型.json"))
    # Folders that are nearly one of a kind.
    for name, files in [("lists", ["depth.txt", "rgb.txt", "groundtruth.txt"]), ("described", ["recording.json"])]:
        at(name).mkdir()
        for file in files:
            at(f"{name}/{file}").write_bytes(b"")
    (at("hollows")).mkdir()
    shutil.copy(at("rec/recording.json"), at("hollows"))
    for k in range(5000):
        at(f"hollows/{k}").mkdir()
        at(f"hollows/{k}/depth.txt").write_bytes(b"")
    at("long-list").mkdir()
    first = next(at("film/depth").iterdir())
    shutil.copy(first, at("long-list/a.png"))
    at("long-list/depth.txt").write_text("".join(f"{k / 30:.6f} a.png\n" for k in range(200_000)))
    os.symlink("loop", at("loop"))
    os.symlink("nowhere", at("dangling"))
    os.symlink("rec", at("link"))
    os.symlink("..", at("hidden/up"))
    return ["", ".", "..", "/", "/dev/null", "/dev/stdin", "-", "/proc/self/mem", "/proc/self/maps", "/sys", "nowhere", "loop", "dangling", "link", "rec/", "rec/.", "./rec/../rec", "rec/0000",
            "rec/recording.json", "film/depth", "x" * 5000, "rec/recording.json/x", "hollow", "folders", "hidden", "lists", "described", "hollows", "long-list", "模型.json",
            "empty", "empty.json", "empty.csv", "empty.bag", "empty.npy", "empty.npz", "empty.mcap", "empty.db3", "zeros.json", "deep.json", "deeper.json", "mark.json", "wide.csv", "lines.txt",
            "newlines.txt", "one.txt", "utf16.json", "crlf.txt", "crlf.csv", "old-mac.csv", *odd]


def odd_outputs(desk):
    at = desk.at
    for name in ["full", "made", "locked"]:
        at(name).mkdir()
    at("full/keep.txt").write_text("somebody's\n")
    at("plain").write_text("somebody's\n")
    os.symlink("gone/further", at("broken"))
    os.symlink("full", at("to-full"))
    os.symlink("/", at("to-root"))
    os.chmod(at("locked"), 0o555)
    return ["", ".", "..", "/", "/dev/null", "/dev/full", "/dev/stdout", "/proc/self/x", "/sys/x", "-", "--", "out", "out/", "out/deep/er", "./out/../out2", "full", "full/x", "plain", "plain/x", "made",
            "locked", "locked/x", "broken", "to-full", "to-root", "loop", "dangling", "rec", "rec/out", "rec/0000", "film", "model.json", "link", "out räume 😀", "out\nnew", "x" * 255, "x" * 256, "x" * 5000,
            "a/" * 3000, "out.d", "out%s", "rec/recording.json"]


def kept(root, names):
    """What stands there, file by file; more may come."""
    found = {}
    for name in names:
        inside = tree(root / name)
        found.update({f"{name}/{k}": v for k, v in inside.items()} if isinstance(inside, dict) else {name: inside})
    return found


def places(binary, rng, times):
    """Inputs and what else stood there stay as they were, whatever the command."""
    tally = Tally("odd inputs, and results in odd places")
    # What may not be written is so for nobody, not for root.
    drop = (lambda: (os.setgroups([]), os.setgid(65534), os.setuid(65534))) if os.getuid() == 0 else None
    with Desk(binary) as desk:
        materials(desk)
        inputs, outputs = odd_inputs(desk), odd_outputs(desk)
        subprocess.run(["chmod", "-R", "a+rX", desk.root], check=True)
        os.chmod(desk.root, 0o777)
        os.chmod(desk.at("locked"), 0o555)
        guarded = [n for n in [*GOOD, "full", "plain", "模型.json"]]
        before = kept(desk.root, guarded)
        stock = Path(f"{desk.root}-stock")
        subprocess.run(["cp", "-a", desk.root, stock], check=True)
        known = set(os.listdir(desk.root))
        for _ in range(times):
            line = rng.choice(COMMANDS)
            odd = rng.choice(["in", "in", "out", "out", "both"])
            good = next((name for word, name in MEANT.items() if word in line), "rec")
            given = {"IN": rng.choice(inputs) if odd != "out" else good, "OUT": rng.choice(outputs) if odd != "in" else "out"}
            words = []
            for word in line.split(" "):
                head, _, last = word.rpartition(":")
                words.append(f"{head}:{given[last]}" if head and last in given else given.get(word, word))
            words += rng.choice([[], [], ["--json"], ["-v"], ["-q"], ["--force"], ["--threads", "1024"]])
            ran = desk.run(words, preexec_fn=drop)
            place = desk.at(given["OUT"]) if given["OUT"].startswith("out") and "OUT" in line else None
            wrong = complaints(ran, place if ran.code == 0 else None) + [f"{p} is left" for p in desk.unfinished()]
            after = kept(desk.root, guarded)
            # An export is a file that replaces another, as a compiler's is.
            meant = given["OUT"] if line.startswith("export") and given["OUT"] != given["IN"] else None
            lost = [n for n in before if after.get(n) != before[n] and n != meant]
            wrong += [f"{n} is not as it was" for n in lost]
            tally.add(ran.code, wrong, repr([w[:60] for w in words]))
            for name in set(os.listdir(desk.root)) - known:
                desk.remove(name)
            desk.tidy()
            if after != before:
                shutil.rmtree(desk.root)
                subprocess.run(["cp", "-a", stock, desk.root], check=True)
        shutil.rmtree(stock)
    return [tally.row()]
