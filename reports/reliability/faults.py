"""Faults of the machine: kills, full disks, answers that nobody gets, two runs at once."""

import os
import signal
import subprocess
import time
from pathlib import Path

from desk import Desk, Ran, Tally, UNFINISHED, complaints, tree

SIMULATE = "simulate rec --shrink 4 --frames 2 --distances 1,1.5,2,2.5,3 --tilts 0,30,60"
WRITERS = ["calibrate rec -o out", "diagnose rec -o out", "correct rec -m cal/model.json -o out", "man out",
           "simulate out --shrink 8 --frames 4 --distances 1,2,3 --tilts 0,40", "metrics rec -o out",
           "simulate out --room --shrink 8 --frames 12", "map film -o out", "sigma film -m cal/model.json -o out",
           "export cal/model.json --format npz -o out"]
# What results hold of the clock and of memory, and what marks each as whole.
TIMED = {"stats.json", "map.html", "frames.csv"}
MARKS = {"calibrate": {"measurements.csv", "sigma.svg"}, "diagnose": {"diagnosis.json"}, "correct": {"recording.json"},
         "man": {"kinoise.1"}, "simulate": {"recording.json", "depth.txt"}, "metrics": {"metrics.json"},
         "map": {"trajectory.txt"}, "sigma": {"sigma.txt"}}


def bench(desk):
    desk.made(SIMULATE)
    desk.made("calibrate rec -o cal")
    desk.made("simulate film --room --shrink 4 --frames 4")


def alike(one, other):
    """The same result, but for what a clock wrote."""
    if one is None or other is None or isinstance(one, bytes) or isinstance(other, bytes):
        return one == other
    return one.keys() == other.keys() and all(one[k] == other[k] for k in one if Path(k).name not in TIMED)


def visible(result):
    return result if not isinstance(result, dict) else {k: v for k, v in result.items() if not k.startswith(UNFINISHED)}


def stale(desk):
    """As if a minute had passed since the kill."""
    for path in desk.unfinished():
        os.utime(path, (time.time() - 3600,) * 2)


def kills(binary, rng, times):
    """At any moment, over nothing and over the results of an earlier run."""
    rows = []
    with Desk(binary) as desk:
        bench(desk)
        wholes = {line: reference(desk, line) for line in WRITERS}
        for name, stands, share in [("killed (SIGKILL)", False, 1), ("killed over earlier results", True, 1),
                                    ("interrupted (SIGINT, SIGTERM)", None, 0.5)]:
            tally = Tally(name)
            for k in range(int(times * share)):
                line = WRITERS[k % len(WRITERS)]
                kill(desk, rng, tally, line, stands, *wholes[line])
            rows.append(tally.row())
    return rows


def reference(desk, line):
    """What a command leaves that is let alone, and how long it takes."""
    begin = time.monotonic()
    desk.made(line)
    whole, seconds = tree(desk.at("out")), time.monotonic() - begin
    desk.remove("out")
    return whole, seconds


def write(path, result):
    """A result with a byte more in each file: another run's."""
    for name, data in {"": result}.items() if isinstance(result, bytes) else result.items():
        file = path / name if name else path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data + b"\n")


def kill(desk, rng, tally, line, stands, whole, seconds):
    out, earlier = desk.at("out"), None
    if stands:
        write(out, whole)
        earlier = tree(out)
        line += " --force" if line.startswith(("export", "simulate", "correct")) else ""
    number = rng.choice([signal.SIGINT, signal.SIGTERM]) if stands is None else signal.SIGKILL
    child = desk.start(line)
    time.sleep(rng.uniform(0, 1.1 * seconds))
    child.send_signal(number)
    child.communicate()
    found, wrong = visible(tree(out)), []
    marks = MARKS.get(line.split()[0], set())
    unmarked = isinstance(found, dict) and not marks & found.keys()
    if not alike(found, whole) and found != earlier and not (stands and unmarked):
        wrong.append(f"neither whole nor as it was: {sorted(found or [])}")
    if stands is None and desk.unfinished():
        wrong.append(f"left: {desk.unfinished()}")
    # The next run tidies up and is not disturbed.
    stale(desk)
    again = desk.run(line if "--force" in line else line + " --force")
    if again.code not in (0, 1) or not alike(visible(tree(out)), whole):
        wrong.append(f"the next run: {again.code} {again.err[-300:]}")
    for path in desk.unfinished():
        # Set aside for people: the earlier results of a run that was killed while it replaced them.
        if not path.endswith(".old"):
            wrong.append(f"{path} stays for ever")
        subprocess.run(["rm", "-rf", path], check=True)
    tally.add(0 if alike(found, whole) else 2, wrong, line)
    desk.remove("out")


def full_disks(binary, rng, times):
    """A disk of some kilobytes in a namespace of its own, and files that may not grow."""
    rows = []
    with Desk(binary) as desk:
        bench(desk)
        for name, limit in [("disk full (tmpfs)", "mount -t tmpfs -o size={}k none disk || exit 99; "),
                            ("file beyond its limit (ulimit -f)", "ulimit -f {}; ")]:
            tally = Tally(name)
            desk.remove("kept")
            for k in range(times):
                line = WRITERS[k % len(WRITERS)].replace("-o out", "-o disk/out").replace("simulate out", "simulate disk/out").replace("man out", "man disk/out")
                desk.remove("disk")
                desk.remove("kept")
                desk.at("disk").mkdir()
                size = int(2 ** rng.uniform(2 if "tmpfs" in limit else 0, 11))
                script = f'{limit.format(size)}"$0" "$@"; code=$?; ulimit -f unlimited 2>/dev/null; cp -a disk kept; exit $code'
                words = ["unshare", "-rm", "bash", "-c", script, desk.binary, *line.split(" ")]
                ran = subprocess.run(words, cwd=desk.root, env=desk.environment, stdin=subprocess.DEVNULL, capture_output=True, timeout=600)
                ran = Ran(line, ran.returncode, ran.stdout, ran.stderr.decode(), 0, 0)
                if ran.code == 99:
                    return [tally.row("no namespaces here: not tried")]
                wrong = complaints(ran, desk.at("kept/out") if ran.code != 2 else None)
                if ran.code == 2 and not any(w in ran.err for w in ("make room", "ulimit -f")):
                    wrong.append(f"does not say what to do: {ran.err[-300:]}")
                left = [p.name for p in desk.at("kept").iterdir()] if ran.code == 2 and desk.at("kept").exists() else []
                tally.add(ran.code, wrong + [f"left: {p}" for p in left], f"{line} on {size} kB")
            rows.append(tally.row())
    return rows


def lost_answers(binary, rng, times):
    """Standard output and standard error on a full disk, closed, or a pipe that nobody reads."""
    tally = Tally("stdout or stderr full, closed or broken")
    commands = ["effects --list", "effects --json", "schema model", "completions zsh", "metrics rec --json", "--help",
                "calibrate rec -o out --json", "calibrate none -o out", "no-such-command"]
    with Desk(binary) as desk:
        bench(desk)
        for _ in range(times):
            line = rng.choice(commands)
            bad = line in commands[-2:]
            stream = rng.choice(["", "2"])
            how = rng.choice([f"{stream}>/dev/full", f"{stream}>&-", f"{stream}> >(:)"])
            words = ["bash", "-c", f'exec {how}; sleep 0.02; exec "$0" "$@"', desk.binary, *line.split(" ")]
            ran = subprocess.run(words, cwd=desk.root, env=desk.environment, capture_output=True)
            wrong = [] if ran.returncode in (0, 2) else [f"exit code {ran.returncode}"]
            if how == ">/dev/full" and not bad and line != "--help" and ran.returncode != 2:
                wrong.append("an answer is lost and nobody told")
            if stream == "2" and not bad and ran.returncode != 0:
                wrong.append("a lost message is no failure")
            tally.add(ran.returncode, wrong, f"{line} {how}")
            desk.remove("out")
    return [tally.row()]


def two_runs(binary, rng, times):
    """Two of the same command at once, into a place where nothing stands or where results do."""
    tally = Tally("two runs into one folder")
    with Desk(binary) as desk:
        bench(desk)
        desk.made("simulate rec2 --shrink 4 --frames 2 --distances 1,1.5,2,3 --tilts 0,30,60 --seed 5")
        pairs = [("calibrate rec -o out", "calibrate rec2 -o out"), ("metrics rec -o out", "metrics rec2 -o out"),
                 ("correct rec -m cal/model.json -o out", "correct rec2 -m cal/model.json -o out"),
                 ("export cal/model.json --format c -o out --force", "export cal/model.json --format python -o out --force")]
        wholes = {}
        for line in {l for pair in pairs for l in pair}:
            desk.remove("out")
            desk.made(line)
            wholes[line] = tree(desk.at("out"))
        for k in range(times):
            pair = pairs[k % len(pairs)]
            stands = rng.random() < 0.5 and not pair[0].startswith("correct")
            desk.remove("out")
            if stands:
                desk.made(pair[0])
            children = []
            for line in pair:
                children.append(desk.start(line))
                time.sleep(rng.uniform(0, 0.03))
            ended = [(c.communicate()[1].decode(), c.returncode) for c in children]
            for line, (err, code) in zip(pair, ended):
                ran = Ran(line, code, b"", err, 0, 0)
                wrong = complaints(ran)
                if code == 2 and not any(w in err for w in ("another run", "are kept in", "not empty", "there is such")):
                    wrong.append(f"refused for another reason: {err[-300:]}")
                tally.add(code, wrong, line)
            if all(code == 2 for _, code in ended):
                tally.broken.append(f"{pair}: neither was done: {ended}")
            found = tree(desk.at("out"))
            if found not in [wholes[line] for line in pair]:
                tally.broken.append(f"{pair}: a mixture: {sorted(found or [])}")
            for path in desk.at(".").glob(".kinoise-*"):
                if tree(path) not in [wholes[line] for line in pair]:
                    tally.broken.append(f"{pair}: half of a result is kept in {path}")
                subprocess.run(["rm", "-rf", path], check=True)
    return [tally.row()]
