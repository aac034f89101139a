"""Inputs that go wrong as a whole: files that cannot be read or change, recordings that are long, paths
that lead out, names with markup."""

import json
import os
import random
import shutil
import tempfile
import threading
import time
from pathlib import Path
from xml.etree import ElementTree

from desk import Desk, Page, Tally, complaints, files, tree


def many_views(desk, name, count):
    """Links to the views of rec under as many names."""
    views = sorted(p for p in desk.at("rec").iterdir() if p.is_dir())
    desk.at(name).mkdir()
    shutil.copy(desk.at("rec/recording.json"), desk.at(name))
    for k in range(count):
        shutil.copytree(views[k % len(views)], desk.at(f"{name}/{k:05}"), copy_function=os.link)


def unreadable(binary, rng, times):
    """One file of 2,000 views: as nobody, who may not read what root keeps, or a folder in its place."""
    tally = Tally("one unreadable file among 2,000 views")
    with Desk(binary) as desk:
        os.chmod(desk.root, 0o777)
        desk.made("simulate rec --shrink 8 --frames 1 --distances 1,1.5,2,3 --tilts 0,40")
        many_views(desk, "many", 2000)
        desk.made("calibrate many -o whole")
        table = desk.at("whole/measurements.csv").read_text().splitlines()
        as_nobody = lambda: (os.setgid(65534), os.setuid(65534)) if os.getuid() == 0 else None
        for k in range(times):
            view = f"{rng.randrange(2000):05}"
            name = rng.choice(["depth/0000.png", "depth.txt", "", "depth"])
            victim = desk.at(f"many/{view}/{name}".rstrip("/"))
            aside = desk.at("aside")
            shutil.move(victim, aside)
            if rng.random() < 0.3:
                victim.mkdir() if name.endswith(("png", "txt")) else victim.write_text("no folder")
            elif aside.is_dir():
                victim.mkdir(mode=0o000)
            else:
                shutil.copy(aside, victim)
                os.chmod(victim, 0o000)
            desk.at("out").mkdir()
            os.chmod(desk.at("out"), 0o777)
            ran = desk.run("calibrate many -o out", preexec_fn=as_nobody)
            wrong = complaints(ran, desk.at("out"))
            if ran.code == 0:
                rows = desk.at("out/measurements.csv").read_text().splitlines()
                if rows != [r for r in table if not r.startswith(f"{view},")]:
                    wrong.append(f"other views are not as they were ({len(rows)} rows)")
                if view not in ran.err:
                    wrong.append(f"{view} is missing, and nobody is told: {ran.err[-300:]}")
            tally.add(ran.code, wrong, f"{view}/{name}")
            desk.remove(f"many/{view}/{name}".rstrip("/"))
            shutil.move(aside, victim)
            desk.remove("out")
    return [tally.row()]


def changing(binary, rng, times):
    """Files are removed, cut, replaced and renamed as fast as it goes while they are read."""
    tally = Tally("a folder that changes while it is read")
    with Desk(binary) as desk:
        desk.made("simulate rec --shrink 4 --frames 3 --distances 1,1.5,2,3 --tilts 0,40")
        desk.made("calibrate rec -o cal")
        many_views(desk, "many", 60)
        desk.made("simulate film --room --shrink 4 --frames 8")
        lines = ["calibrate many -o out", "metrics many -o out", "correct many -m cal/model.json -o out",
                 "map film -o out", "sigma film -m cal/model.json -o out", "metrics film -o out"]
        for k in range(times):
            line = lines[k % len(lines)]
            source = line.split()[1]
            desk.copy(source, "input")
            paths = [p for p in desk.at("input").rglob("*") if p.is_file()]
            stop = threading.Event()
            worker = threading.Thread(target=disturb, args=(random.Random(rng.random()), paths, stop))
            worker.start()
            ran = desk.run(line.replace(source, "input", 1))
            stop.set()
            worker.join()
            left = [f"{p} is left" for p in desk.unfinished()]
            tally.add(ran.code, complaints(ran, desk.at("out"), desk.at("input")) + left, line)
            desk.remove("out")
            desk.remove("input")
    return [tally.row()]


def disturb(rng, paths, stop):
    while not stop.is_set():
        path = rng.choice(paths)
        try:
            kind = rng.randrange(6)
            data = path.read_bytes() if kind else b""
            path.unlink()
            if kind == 1:
                path.mkdir()
            elif kind == 2:
                path.write_bytes(data[: rng.randrange(len(data) + 1)])
            elif kind == 3:
                path.write_bytes(rng.choice(paths).read_bytes())
            elif kind == 4:
                path.parent.rename(path.parent.with_name(f"moved{rng.randrange(10**6)}"))
            elif kind == 5:
                path.write_bytes(data + data)
        except OSError:
            pass  # it has gone already
        time.sleep(rng.uniform(0, 0.02))


def long_recordings(binary, rng, times):
    """Peak memory of calibrate for a recording, ten and a hundred times as much of it."""
    rows = []
    with Desk(binary) as desk:
        desk.made("simulate rec --shrink 1 --frames 4 --distances 1,2,3,4 --tilts 0,40")
        by_frames, by_views = [], []
        tally = Tally("a recording 1, 10 and 100 times as long, and of as many views")
        for factor in (1, 10, 100):
            desk.remove("long")
            shutil.copytree(desk.at("rec"), desk.at("long"))
            for lines in desk.at("long").glob("*/depth.txt"):
                images = [l.split()[1] for l in lines.read_text().splitlines() if not l.startswith("#")]
                frames = [f"{k / 30:.6f} {images[k % len(images)]}" for k in range(5 * factor)]
                lines.write_text("\n".join(frames) + "\n")
            by_frames.append(peak(desk, tally, "calibrate long -o out"))
            desk.remove("many")
            many_views(desk, "many", 8 * factor)
            by_views.append(peak(desk, tally, "calibrate many -o out"))
        for peaks in (by_frames, by_views):
            # The last factor of ten may cost what tables and pages of so many rows take.
            if peaks[-1] > 2 * peaks[0] and peaks[-1] > 300:
                tally.broken.append(f"{peaks} MB")
        words = lambda peaks: ", ".join(f"{p:.0f}" for p in peaks)
        note = f"peak MB: {words(by_frames)} for 40, 400 and 4,000 frames of 640 x 480 px in 8 views; {words(by_views)} for 8, 80 and 800 views"
        rows.append(tally.row(note))
    return rows


def peak(desk, tally, line):
    child = desk.start(line + " --threads 2")
    child.stdout.close()
    child.stderr.close()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    tally.add(child.returncode, [] if child.returncode == 0 else [f"exit code {child.returncode}"], line)
    desk.remove("out")
    return usage.ru_maxrss * 1024 / 1e6


SECRET = b"a private key"


def ways_out(binary, rng, times):
    """Lists, links and archives that name files outside the recording."""
    tally = Tally("paths that lead out of a recording")
    with Desk(binary) as desk:
        desk.made("simulate rec --shrink 8 --frames 2 --distances 1,1.5,2,3 --tilts 0,40 --infrared")
        desk.made("calibrate rec -o cal")
        desk.made("simulate film --room --shrink 8 --frames 4")
        outside = Path(tempfile.mkdtemp(prefix="kinoise-outside-"))
        shutil.copy(next(desk.at("rec").glob("*/depth/*.png")), outside / "x.png")
        (outside / "secret.txt").write_bytes(SECRET)
        before = tree(outside)
        deep = "../" * rng.choice([1, 3, 12])
        named = [str(outside / "x.png"), f"{deep}{outside}/x.png", f"depth/../../../../..{outside}/x.png", "depth//../../../rec/0000/depth/0000.png"]
        for k in range(times):
            source, target = rng.choice(["rec", "film"]), rng.choice(named)
            desk.remove("input")
            shutil.copytree(desk.at(source), desk.at("input"))
            how = rng.choice(["list", "link", "folder link", "list beside"])
            view = "0000/" if source == "rec" else ""
            if how.startswith("list"):
                lists = {"list": "depth.txt", "list beside": "ir.txt" if view else "rgb.txt"}
                path = desk.at(f"input/{view}{lists[how]}")
                path.write_text(path.read_text().rstrip().rsplit(" ", 1)[0] + f" {target}\n")
            elif how == "link":
                desk.at(f"input/{view}notes.txt").symlink_to(outside / "secret.txt")
            else:
                desk.at(f"input/{view}more").symlink_to(outside)
            line = rng.choice(["correct input -m cal/model.json -o out/deep/er", "calibrate input -o out --force", "sigma input -m cal/model.json -o out"])
            ran = desk.run(line)
            wrong = complaints(ran)
            if tree(outside) != before:
                wrong.append("something outside was changed")
            taken = [p for p in files(desk.at("out")) if SECRET in p.read_bytes()] if desk.at("out").exists() else []
            linked = [p for p in desk.at("out").rglob("*") if p.is_symlink()] if desk.at("out").exists() else []
            wrong += [f"{p} is of outside" for p in taken + linked]
            if line.startswith("correct") and ran.code == 0 and "left out" not in ran.err:
                wrong.append("written again without what it names")
            tally.add(ran.code, wrong, f"{line}, {how} {target}")
            desk.remove("out")
        shutil.rmtree(outside)
    return [tally.row()]


MARKUP = ["<script>alert(1)</script>", "\"><img src=x onerror=alert(1)>", "</title></style><svg onload=alert(1)>", "'><b onmouseover='alert(1)",
          "]]><x>&amp;&lt;", "</script><script>alert(1)//", "{{7*7}}${7*7}", "<!--", "javascript:alert(1)", "&#60;script&#62;alert(1)"]


def markup(binary, rng, times):
    """Names, notes and options with markup, in every page and picture."""
    tally = Tally("names with markup in every page and SVG")
    pages = drawings = named = 0
    with Desk(binary) as desk:
        desk.made("simulate rec --shrink 4 --frames 2 --distances 1,1.5,2,2.5,3 --tilts 0,40 --effect radial-disparity-bias:k_px=0.3")
        desk.made("simulate film --room --shrink 4 --frames 36")
        desk.made("calibrate rec -o cal")
        for k in range(times):
            evil = MARKUP[k % len(MARKUP)]
            name = evil.replace("/", "∕")
            desk.remove("out")
            for source in ["rec", "film", "cal"]:
                desk.remove(f"{source} {name}")
                shutil.copytree(desk.at(source), desk.at(f"{source} {name}"))
            spoil(desk, f"rec {name}", f"cal {name}", evil, name)
            lines = [["calibrate", f"rec {name}", "-o", f"out/{name}"], ["diagnose", f"rec {name}", "-m", f"cal {name}/model.json", "-o", f"out/dia {name}"],
                     ["metrics", f"rec {name}", "-o", f"out/metrics {name}"], ["map", f"film {name}", "-o", f"out/map {name}"],
                     ["compare", f"film {name}", "-m", f"cal {name}/model.json", "-o", f"out/compare {name}"],
                     ["evaluate", "--truth", f"film {name}/groundtruth.txt", "--estimate", f"film {name}/groundtruth.txt", "-o", f"out/evaluate {name}"]]
            for words in lines:
                ran = desk.run(words)
                place = desk.at(words[-1])
                wrong = complaints(ran, place)
                if place.exists():
                    for path in files(place):
                        pages += path.suffix == ".html"
                        drawings += path.suffix == ".svg"
                        named += path.suffix in (".html", ".svg") and any(w in path.read_bytes() for w in (b"alert(1)", b"7*7", b"amp;"))
                        wrong += foreign(path)
                tally.add(ran.code, wrong, " ".join(words))
            for source in ["rec", "film", "cal"]:
                desk.remove(f"{source} {name}")
    return [tally.row(f"{pages} pages and {drawings} drawings, {named} of them with such a name")]


def spoil(desk, recording, model, evil, name):
    """The markup wherever a user's words go."""
    description = desk.at(f"{recording}/recording.json")
    values = json.loads(description.read_text())
    values.update(sensor=evil, serial=evil)
    description.write_text(json.dumps(values))
    view = desk.at(f"{recording}/0000")
    notes = json.loads((view / "view.json").read_text()) if (view / "view.json").exists() else {}
    (view / "view.json").write_text(json.dumps({**notes, "notes": evil, evil: evil}))
    view.rename(view.with_name(f"0000 {name}"))
    # A view that is left out, with a reason that quotes it.
    (desk.at(f"{recording}/0001") / "depth.txt").write_text(f"0.0 {name}.png\n{evil} x\n")
    path = desk.at(f"{model}/model.json")
    values = json.loads(path.read_text())
    values["sensor"].update(sensor=evil, serial=evil)
    values["provenance"]["options"] = {evil: evil}
    path.write_text(json.dumps(values))


def foreign(path):
    """Elements that no page of the program has."""
    text = path.read_text(errors="replace") if path.suffix in (".html", ".svg") else ""
    if path.suffix == ".svg":
        tags = {e.tag.rsplit("}", 1)[-1] for e in ElementTree.fromstring(text).iter()}
        return [f"{path.name}: <{t}>" for t in tags & {"script", "img", "x", "b", "a", "foreignObject"}]
    if path.suffix == ".html":
        page = Page()
        page.feed(text)
        found = [f"{path.name}: {h}" for h in page.handlers]
        found += [f"{path.name}: <{t}>" for t in set(page.elements) & {"x", "iframe", "object", "embed", "base", "form"}]
        bodies = [part.split(">", 1)[-1] for part in text.split("<script")[1:]]
        return found + [f"{path.name}: a script of a name's" for body in bodies if body.lstrip().startswith("alert(1)")]
    return []
