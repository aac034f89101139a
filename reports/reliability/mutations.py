"""One thing wrong with a file: bits, bytes, lines, numbers, values of JSON, chunks of PNG."""

import json
import re
import struct
import zlib

NUMBERS = ["0", "-0", "-1", "1e-300", "1e300", "-1e308", "1e400", "nan", "NaN", "inf", "-inf", "0x10",
           "99999999999999999999", "4294967296", "-2147483649", "1e155", "0.1.2", "", "１２", "1,5", "\x00"]
VALUES = [None, True, [], {}, "", "nan", -1, 0, 1e308, -1e308, 1e-308, 10**30, 2**63, [[]], [1e308] * 9, "\u202e<b>",
          {"value": None}, {"value": 1e308, "std_error": -1}]
WORDS = [b"\xff\xfe", b"\x00" * 8, b"\xff" * 8, b"../../../etc/passwd", b"%s%n", b"\r\n\r\n", b"# ", b"NaN", b"-", b"1e999"]


def mutated_number(rng, data):
    found = list(re.finditer(rb"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?", data))
    if not found:
        return b"0" + data
    at = rng.choice(found)
    return data[: at.start()] + rng.choice(NUMBERS).encode() + data[at.end() :]


def mutated_lines(rng, data):
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.randrange(5)
    if kind == 0:
        del lines[i]
    elif kind == 1:
        lines.insert(i, lines[j])
    elif kind == 2:
        lines[i], lines[j] = lines[j], lines[i]
    elif kind == 3:
        lines[i] = rng.choice(WORDS)
    else:
        words = lines[i].split(b" ")
        words.pop(rng.randrange(len(words)))
        lines[i] = b" ".join(words)
    return b"\n".join(lines)


def mutated_json(rng, data):
    try:
        whole = json.loads(data)
    except ValueError:
        return mutated_bytes(rng, data)
    places = []

    def walk(node):
        keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else []
        for key in keys:
            places.append((node, key))
            walk(node[key])

    walk(whole)
    if not places:
        return b"[]"
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        node, key = rng.choice(places)
        kind = rng.randrange(6)
        try:
            if kind == 0:
                del node[key]
            elif kind == 1 and isinstance(node, dict):
                node[f"{key}_of_nobody"] = node[key]
            elif kind == 2 and isinstance(node[key], (int, float)):
                node[key] *= rng.choice([-1, 0, 1e3, 1e-3, 1e9, 1e300])
            elif kind == 3 and isinstance(node[key], list):
                node[key] = node[key] * rng.choice([0, 2, 100])
            else:
                node[key] = rng.choice(VALUES)
        except (KeyError, IndexError):
            pass  # a place in what has gone
    return json.dumps(whole, indent=2).encode()


def mutated_bytes(rng, data):
    data = bytearray(data or b"\x00")
    i = rng.randrange(len(data))
    n = min(len(data) - i, rng.choice([1, 2, 4, 8, 64, 1024]))
    kind = rng.randrange(9)
    if kind == 0:
        for _ in range(rng.choice([1, 4, 16])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    elif kind == 1:
        data[i : i + n] = rng.randbytes(n)
    elif kind == 2:
        del data[i:]
    elif kind == 3:
        data += rng.randbytes(n)
    elif kind == 4:
        data[i : i + n] = bytes(n)
    elif kind == 5:
        data[i:i] = data[i : i + n]
    elif kind == 6:
        del data[i : i + n]
    elif kind == 7:
        size = rng.choice([2, 4, 8])
        extreme = rng.choice([0, 1, (1 << 8 * size) - 1, 1 << (8 * size - 1), (1 << (8 * size - 1)) - 1])
        data[i : i + size] = extreme.to_bytes(size, rng.choice(["little", "big"]))
    else:
        return rng.randbytes(rng.choice([0, 1, 16, 4096]))
    return bytes(data)


def mutated_png(rng, data):
    """A chunk with something wrong in it and a right checksum, so that the decoder gets to see it."""
    chunks, at = [], 8
    while at + 12 <= len(data):
        size = struct.unpack(">I", data[at : at + 4])[0]
        chunks.append([data[at + 4 : at + 8], data[at + 8 : at + 8 + size]])
        at += 12 + size
    if not chunks:
        return mutated_bytes(rng, data)
    chunk = rng.choice(chunks)
    kind = rng.randrange(4)
    if chunk[0] == b"IDAT" and kind < 2:
        try:
            chunk[1] = zlib.compress(mutated_bytes(rng, zlib.decompress(chunk[1])))
        except zlib.error:
            pass
    elif kind == 2:
        chunks.insert(rng.randrange(len(chunks)), list(rng.choice(chunks)))
    elif chunk[1]:
        chunk[1] = mutated_bytes(rng, chunk[1])[: 1 << 20]
    else:
        chunks.remove(chunk)
    pack = lambda name, body: struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    return data[:8] + b"".join(pack(*c) for c in chunks)


def mutate(rng, path):
    """Something wrong with one file; what it was."""
    kind = rng.random()
    if kind < 0.04:
        path.unlink()
        return "removed"
    if kind < 0.06:
        path.unlink()
        path.mkdir()
        return "a folder in its place"
    if kind < 0.08:
        path.unlink()
        path.symlink_to(rng.choice([path.name, "/dev/zero", "/proc/self/mem", ".", "/etc"]))
        return "a link in its place"
    data = path.read_bytes()
    is_text = path.suffix in (".json", ".txt", ".csv")
    choices = [mutated_bytes]
    if path.suffix == ".json":
        choices += [mutated_json] * 4 + [mutated_number]
    elif is_text:
        choices += [mutated_number] * 2 + [mutated_lines] * 2
    elif path.suffix == ".png":
        choices += [mutated_png] * 2
    how = rng.choice(choices)
    for _ in range(rng.choice([1, 1, 1, 3])):
        data = how(rng, data)
    path.unlink()  # the original is linked here
    path.write_bytes(data)
    return how.__name__.replace("mutated_", "")
