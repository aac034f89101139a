#!/usr/bin/env python3
"""What was tried on the program, how often, and what came of it; every row by itself again with the same seed.

    python3 reports/reliability/table.py target/release/kinoise [--seed 1] [--times 1.0] [--only ROW ...] [--into README.md]
        [--debug target/debug/kinoise]

Needs Linux and, for full disks, user namespaces; as root the unreadable files are read as nobody. Exits
with 1 if anything broke, after naming it. The row of the two builds needs the one without optimisation. `--times 0.1` does a tenth of each row.
"""

import argparse
import functools
import random
import re
import sys
import time
from pathlib import Path

import builds
import faults
import inputs
import places
import spoilt

# The rows' functions, and how often each tries.
ROWS = {
    "spoilt": (spoilt.spoilt_inputs, 2000),
    "places": (places.places, 400),
    "kills": (faults.kills, 100),
    "disks": (faults.full_disks, 60),
    "answers": (faults.lost_answers, 200),
    "unreadable": (inputs.unreadable, 3),
    "changing": (inputs.changing, 60),
    "two": (faults.two_runs, 60),
    "long": (inputs.long_recordings, 1),
    "out": (inputs.ways_out, 100),
    "markup": (inputs.markup, 10),
    "debug": (builds.debug, 1),
    "clone": (builds.clone, 1),
}
HEAD = "| what was tried | runs | done | refused, with a message | broke |\n|---|--:|--:|--:|--:|"


def cells(row):
    what = f"{row.what} ({row.note})" if row.note else row.what
    return f"| {what} | {row.runs:,} | {row.done:,} | {row.refused:,} | {len(row.broken)} |"


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("binary")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--times", type=float, default=1.0)
    options.add_argument("--only", nargs="*", choices=list(ROWS), default=list(ROWS))
    options.add_argument("--into", help="a page whose table, between its two comments, is replaced")
    options.add_argument("--debug", help="a build without optimisation, for its row")
    given = options.parse_args()
    lines, broken = [HEAD], []
    print(HEAD, flush=True)
    for name in given.only:
        function, times = ROWS[name]
        if name == "debug":
            if not given.debug:
                continue
            function = functools.partial(function, unoptimised=given.debug)
        begin = time.monotonic()
        for row in function(given.binary, random.Random(f"{given.seed} {name}"), max(1, round(given.times * times))):
            lines.append(cells(row))
            print(lines[-1], flush=True)
            for what in row.broken:
                print(f"  {row.what}: {what}", file=sys.stderr, flush=True)
            broken += row.broken
        print(f"  {name}: {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
    if given.into:
        page = Path(given.into)
        table = "<!-- table -->\n" + "\n".join(lines) + "\n<!-- end -->"
        page.write_text(re.sub(r"<!-- table -->.*<!-- end -->", lambda _: table, page.read_text(), flags=re.S))
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
