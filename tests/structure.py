#!/usr/bin/env python3
"""Checks the imports of src: no cycles of files, and imports only from modules listed above.

Reads the `use` lines and the `crate::`, `super::` and child-module paths of every file (tests
excluded), follows re-exports to the file that defines a name, and checks
  1. that the files' imports contain no cycle; every file of a folder may use what the folder's own
     mod.rs declares,
  2. that a module imports only from modules listed above it in src/lib.rs.
Prints violations and exits with 1.   python3 tests/structure.py [FOLDER]   (default: src)
"""

import re
import sys
from pathlib import Path


def strip(text):
    """The code without comments, strings and unit tests."""
    text = re.sub(r'r#"(?:.|\n)*?"#|"(?:[^"\\]|\\.|\\\n)*"', '""', text)
    text = re.sub(r"//[^\n]*", "", text)
    text = re.sub(r"#\[cfg\(test\)\]\s*(#\[path[^\]]*\]\s*)?(pub )?mod \w+;", "", text)
    return re.split(r"#\[cfg\((?:all\()?test[^\n]*\]\s*(?:pub(?:\(\w+\))? )?mod \w+ \{", text)[0]


def leaves(tree, prefix=()):
    """Paths of a use tree, without aliases."""
    tree = tree.strip()
    brace = tree.find("{")
    if brace < 0:
        path = re.sub(r"\s+as\s+\w+$", "", tree)
        yield (*prefix, *path.replace(" ", "").split("::"))
        return
    head = [part for part in tree[:brace].replace(" ", "").split("::") if part]
    depth, start, inner = 0, 0, tree[brace + 1 : tree.rindex("}")]
    for i, c in enumerate(inner + ","):
        depth += (c == "{") - (c == "}")
        if c == "," and depth == 0:
            if inner[start:i].strip():
                yield from leaves(inner[start:i], (*prefix, *head))
            start = i + 1


class File:
    def __init__(self, path, module):
        self.path, self.module = path, module
        self.code = strip(path.read_text(encoding="utf-8"))
        self.children = set(re.findall(r"\bmod (\w+);", self.code)) | set(
            re.findall(r"\$\(mod \$(\w+);\)", self.code)
        )
        self.exports, self.imports = {}, []
        for visibility, tree in re.findall(r"^\s*(pub(?:\([^)]*\))?\s+)?use\s+([^;]+);", self.code, re.M):
            for leaf in leaves(tree):
                if visibility:
                    self.exports.setdefault(leaf[-1], []).append(leaf)
                else:
                    self.imports.append(leaf)
        body = re.sub(r"^\s*(?:pub(?:\([^)]*\))?\s+)?use\s+[^;]+;", "", self.code, flags=re.M)
        names = "|".join(["crate", "super", "self", *self.children])
        for path_text in re.findall(r"(?<![\w:$])((?:%s)(?:::\w+)+)" % names, body):
            self.imports.append(tuple(path_text.split("::")))


class Tree:
    def __init__(self, root):
        self.files = {}
        for path in sorted(root.rglob("*.rs")):
            parts = list(path.relative_to(root).with_suffix("").parts)
            if parts[-1] in ("mod", "lib"):
                parts.pop()
            if parts == ["main"] or any(p == "tests" or p.endswith("_tests") for p in parts):
                continue
            self.files[tuple(parts)] = File(path, tuple(parts))

    def absolute(self, module, path):
        """The path from the crate's root; None for a path of another crate."""
        head, *rest = path
        if head == "crate":
            return tuple(rest)
        if head == "self":
            return (*module, *rest)
        if head == "super":
            while rest and rest[0] == "super":
                module, rest = module[:-1], rest[1:]
            return (*module[:-1], *rest)
        return (*module, *path) if (*module, head) in self.files else None

    def defined_in(self, path, seen=()):
        """Modules that define what a path from the root names."""
        module = ()
        while len(module) < len(path) and (*module, path[len(module)]) in self.files:
            module = (*module, path[len(module)])
        rest = path[len(module) :]
        if not rest or path in seen:
            return {module}
        file = self.files[module]
        aims = file.exports.get(rest[0], [])
        found = set()
        for aim in aims:
            aim = self.absolute(module, aim)
            if aim is not None:
                found |= self.defined_in((*aim, *rest[1:]), (*seen, path))
        return found or {module}

    def edges(self):
        for module, file in self.files.items():
            for path in file.imports:
                path = self.absolute(module, path)
                for aim in self.defined_in(path) if path else ():
                    if aim != module and aim:
                        yield module, aim


def circles(edges):
    """Groups of files that import one another in a cycle (Tarjan)."""
    graph = {}
    for a, b in edges:
        graph.setdefault(a, set()).add(b)
    index, low, stack, groups = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for aim in graph.get(node, ()):
            if aim not in index:
                visit(aim)
            if aim in stack:
                low[node] = min(low[node], low[aim])
        if low[node] == index[node]:
            group = []
            while True:
                group.append(stack.pop())
                if group[-1] == node:
                    break
            if len(group) > 1:
                groups.append(sorted(group))

    for node in list(graph):
        if node not in index:
            visit(node)
    return groups


def main():
    root = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent.parent / "src")
    sys.setrecursionlimit(10_000)
    tree = Tree(root)
    edges = set(tree.edges())
    order = re.findall(r"^pub mod (\w+);", (root / "lib.rs").read_text(encoding="utf-8"), re.M)
    order += [name for name in ("cli",) if name not in order]
    place = {name: k for k, name in enumerate(order)}
    name = lambda module: "::".join(module) or "lib"
    faults = []
    inner = [(a, b) for a, b in edges if a[: len(b)] != b]
    for group in circles(inner):
        members = set(group)
        arrows = sorted(f"{name(a)} -> {name(b)}" for a, b in inner if a in members and b in members)
        faults.append("circle: " + ", ".join(map(name, group)) + "\n    " + "\n    ".join(arrows))
    for a, b in sorted(edges):
        if place.get(b[0], -1) > place.get(a[0], len(place)):
            faults.append(f"downward: {name(a)} imports {name(b)}, listed below it in lib.rs")
    for fault in faults:
        print(fault)
    if not faults:
        print(f"{len(tree.files)} files, {len(edges)} imports: no circle, no import downward")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
