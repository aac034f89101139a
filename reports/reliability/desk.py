"""Runs of the program, and what none of them may do."""

import html.parser
import json
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple, Optional
from xml.etree import ElementTree

# Of processor time, which a busy machine does not stretch; and of a wait for nothing.
MAX_CPU_SECONDS = 20
MAX_SECONDS = 300
# Of address space, bytes: an allocation beyond it aborts, which a signal tells.
MAX_MEMORY = 4 << 30
UNFINISHED = ".kinoise-"


class Ran(NamedTuple):
    line: str
    code: Optional[int]  # None: it hung; negative: a signal's number
    out: bytes
    err: str
    seconds: float
    rss_mb: float


class Row(NamedTuple):
    what: str
    runs: int
    done: int
    refused: int
    broken: list
    note: str = ""


def limit():
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_CPU_SECONDS, MAX_CPU_SECONDS + 1))


class Tally:
    """Counts runs and keeps what broke."""

    def __init__(self, what):
        self.what, self.runs, self.done, self.refused, self.broken = what, 0, 0, 0, []

    def add(self, code, complaints, about):
        self.runs += 1
        self.done += code in (0, 1)
        self.refused += code == 2
        self.broken += [f"{about}: {c}" for c in complaints]

    def row(self, note=""):
        return Row(self.what, self.runs, self.done, self.refused, self.broken, note)


class Desk:
    """A folder to work in, thrown away at the end; names in commands stand for paths in it."""

    def __init__(self, binary):
        self.binary = str(Path(binary).resolve())
        self.root = Path(tempfile.mkdtemp(prefix="kinoise-reliability-"))
        self.environment = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000", "LC_ALL": "C.UTF-8"}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for folder, _, _ in os.walk(self.root):
            os.chmod(folder, 0o755)
        shutil.rmtree(self.root)

    def at(self, name):
        return self.root / name

    def start(self, line, **options):
        words = line if isinstance(line, list) else line.split(" ")
        options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
        return subprocess.Popen([self.binary, *words], cwd=self.root, env=self.environment,
                                stdin=subprocess.DEVNULL, **options)

    def run(self, line, seconds=MAX_SECONDS, **options):
        begin = time.monotonic()
        child = self.start(line, **{"preexec_fn": limit, **options})
        try:
            out, err = child.communicate(timeout=seconds)
            code = child.returncode
        except subprocess.TimeoutExpired:
            child.kill()
            out, err = child.communicate()
            code = None
        took = time.monotonic() - begin
        return Ran(str(line), code, out or b"", (err or b"").decode("utf-8", "replace"), took, 0.0)

    def made(self, line):
        """For what the trials need; its failure ends them."""
        ran = self.run(line, seconds=600)
        if ran.code not in (0, 1):
            raise SystemExit(f"{line}: {ran.err}")
        return ran

    def copy(self, name, to):
        """A copy whose files are links: who changes one removes it first."""
        source, target = self.at(name), self.at(to)
        self.remove(to)
        if source.is_dir():
            shutil.copytree(source, target, copy_function=os.link, symlinks=True)
        else:
            os.link(source, target)
        return target

    def remove(self, name):
        path = self.at(name)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        elif path.is_symlink() or path.exists():
            path.unlink()

    def keep(self, name, label):
        """What broke a run, for whoever mends it."""
        target = Path(tempfile.gettempdir()) / "kinoise-broken" / label
        target.parent.mkdir(exist_ok=True)
        subprocess.run(["cp", "-a", self.at(name), target], check=False)

    def unfinished(self):
        """What is being filled, anywhere; a run that has ended leaves none."""
        found = []
        for folder, folders, files in os.walk(self.root):
            found += [os.path.join(folder, n) for n in folders + files if n.startswith(UNFINISHED)]
        return found

    def tidy(self):
        for path in self.unfinished():
            subprocess.run(["rm", "-rf", path], check=True)


def tree(path):
    """Names and bytes; None where nothing is."""
    if not path.exists():
        return None
    if path.is_file():
        return path.read_bytes()
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


def complaints(ran, place=None, source=None):
    """What a run did that none may do. `place` is what it was to write, where nothing stood before; an
    image that cannot be read may be copied from `source` as it is."""
    found = []
    if ran.code is None:
        return [f"it hung ({MAX_SECONDS} s)"]
    if ran.code < 0:
        return [f"killed by signal {-ran.code} ({signal.Signals(-ran.code).name}): {ran.err[-300:]}"]
    if ran.code not in (0, 1, 2):
        return [f"exit code {ran.code}: {ran.err[-500:]}"]
    if ran.code == 2:
        last = ran.err.rstrip("\n").rsplit("\n", 1)[-1]
        if not last.startswith("kinoise: "):
            found.append(f"failed without a message: {ran.err[-300:]!r}")
        if len(ran.err) > 100_000:
            found.append(f"a message of {len(ran.err)} bytes")
    elif place is not None and not place.exists():
        found.append("success without a result")
    if ran.out.strip().startswith((b"{", b"[")):
        found += json_complaints("stdout", ran.out.decode("utf-8", "replace"))
    if place is not None and place.exists():
        copied = lambda path: source is not None and path.suffix == ".png" and path.read_bytes() in spoilt_images(source)
        found += [c for path in files(place) for c in file_complaints(path) if not copied(path)]
    return found


def spoilt_images(source):
    return {p.read_bytes() for p in source.rglob("*.png") if p.is_file()} if source.is_dir() else set()


def files(place):
    return [place] if place.is_file() else [p for p in place.rglob("*") if p.is_file()]


def refuse_constant(name):
    raise ValueError(f"{name} is no number")


def json_complaints(name, text):
    try:
        json.loads(text, parse_constant=refuse_constant)
    except ValueError as e:
        return [f"{name}: {e}"]
    return []


NO_NUMBER = re.compile(r"(?<![\w.])[-+]?(nan|inf|infinity)(?![\w.])", re.I)


class Page(html.parser.HTMLParser):
    """Collects a page's elements and the attributes that hold numbers."""

    NUMBERS = {"d", "points", "x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "width", "height"}

    def __init__(self):
        super().__init__()
        self.elements, self.handlers, self.spoilt = [], [], []

    def handle_starttag(self, tag, attributes):
        self.elements.append(tag)
        for name, value in attributes:
            calls = name in ("href", "src", "action") and (value or "").strip().lower().startswith("javascript:")
            if name.startswith("on") or calls:
                self.handlers.append(f"{tag} {name}={value}")
            if name == "src" and not (value or "").startswith("data:"):
                self.handlers.append(f"{tag} src={value}")
            if name in self.NUMBERS and NO_NUMBER.search(value or ""):
                self.spoilt.append(f"{tag} {name}={value[:60]}")


def file_complaints(path):
    """Is a result whole, and every number in it one?"""
    name, kind = path.name, path.suffix
    data = path.read_bytes()
    if kind in (".json", ".csv", ".txt", ".svg", ".html") and not data and name != "view.json":
        return [f"{name} is empty"]
    text = data.decode("utf-8", "replace")
    if kind == ".json":
        return json_complaints(name, text)
    if kind == ".csv" or name in ("trajectory.txt", "sigma.txt"):
        lines = [l for l in text.splitlines() if NO_NUMBER.search(l.split(",", 1)[-1])]
        return [f"{name}: {lines[0][:200]}"] if lines else []
    if kind == ".svg":
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError as e:
            return [f"{name}: {e}"]
        bad = [f"{k}={v[:60]}" for e in root.iter() for k, v in e.attrib.items()
               if k in Page.NUMBERS and NO_NUMBER.search(v)]
        return [f"{name}: {bad[0]}"] if bad else []
    if kind == ".html":
        page = Page()
        page.feed(text)
        whole = [] if text.rstrip().endswith("</html>") else [f"{name} has no end"]
        return whole + [f"{name}: {s}" for s in page.spoilt[:1]]
    if kind == ".png":
        return [] if data.endswith(b"IEND\xaeB`\x82") else [f"{name} has no end"]
    if kind == ".ply":
        return ply_complaints(name, data)
    return []


def ply_complaints(name, data):
    head, _, body = data.partition(b"end_header\n")
    count = int(re.search(rb"element vertex (\d+)", head)[1])
    kinds = {b"float": "f", b"uchar": "B"}
    row = struct.Struct("<" + "".join(kinds[k] for k in re.findall(rb"property (\w+) \w+", head)))
    if len(body) != count * row.size:
        return [f"{name}: {len(body)} bytes for {count} points"]
    bad = [p for p in row.iter_unpack(body) if not all(abs(v) < 1e30 for v in p)]
    return [f"{name}: a point at {bad[0]}"] if bad else []
