# SPDX-License-Identifier: GPL-3.0-or-later
"""The house is as docs/architecture.md has it: layers, a row for every file, nothing too long to hold."""

import ast
import functools
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROOMS = PAGE[PAGE.index("## Rooms") : PAGE.index("## Where to add")]
# From the ground up: each may use what stands before it.
LAYERS = ("projection", "casting", "shading", "bridge", "scanline", "cycles", "operators", "panels")
PURE = LAYERS[:3]
LONGEST_FILE, LONGEST_FUNCTION = 500, 80


def is_code(path):
    """Whether a file is ours, not something that was made or installed here."""
    parts = path.relative_to(ROOT).parts
    return not any(part.startswith(".") or part in ("dist", "build", "wheels") for part in parts)


FILES = sorted(path for path in ROOT.rglob("*.py") if is_code(path))


@functools.cache
def parsed(path):
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def layer_of(path):
    """The layer that a file of the extension belongs to; None for other files."""
    parts = path.relative_to(ROOT).parts
    part = parts[1] if parts[0] == "scfpf_addon" and len(parts) > 2 else parts[0]
    return part if part in LAYERS else None


def imported(path):
    """The modules that a file imports, in full, wherever in it."""
    package = path.relative_to(ROOT).with_suffix("").parts
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(package[: -node.level]) if node.level else ""
            start = ".".join(part for part in (base, node.module) if part)
            yield from (f"{start}.{alias.name}" for alias in node.names)


def named_rooms():
    """Every path in the first column of the table; the first one of a cell gives the others its folder."""
    for line in ROOMS.splitlines():
        cells = line.split(" | ")
        if not line.startswith("| `"):
            continue
        folder = ""
        for name in re.findall(r"`([^`]+)`", cells[0]):
            folder = name.rpartition("/")[0] if "/" in name else folder
            yield name if "/" in name or name == "dev.py" else f"{folder}/{name}", cells[1]


def test_arrows_point_one_way():
    for path in FILES:
        layer = layer_of(path)
        if layer is None:
            continue
        allowed = LAYERS[: LAYERS.index(layer) + 1]
        for module in imported(path):
            parts = module.removeprefix("scfpf_addon.").split(".")
            assert parts[0] not in LAYERS or parts[0] in allowed, f"{path.relative_to(ROOT)} imports {module}"
            if layer in PURE:
                assert parts[0] not in ("bpy", "mathutils", "gpu"), (
                    f"{path.relative_to(ROOT)} imports {module}"
                )


def test_every_room_is_there():
    rooms = dict(named_rooms())
    assert len(rooms) > 100
    for name in rooms:
        place = ROOT / name
        assert place.exists() or (ROOT / "scfpf_addon" / name).exists(), f"docs/architecture.md names {name}"


def test_every_file_has_a_room():
    """A row of its own, or its name without .py in the row of its folder."""
    rooms = dict(named_rooms())
    for path in FILES:
        name = str(path.relative_to(ROOT).as_posix()).removeprefix("scfpf_addon/")
        if path.name == "__init__.py" or name in rooms or name.startswith("tests/"):
            continue
        folder = rooms.get(f"{path.parent.relative_to(ROOT).as_posix().removeprefix('scfpf_addon/')}/", "")
        assert re.search(rf"`{path.stem}(\.py)?`", folder), f"docs/architecture.md has no room for {name}"


def test_nothing_is_too_long():
    for path in FILES:
        name, tree = path.relative_to(ROOT), parsed(path)
        assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE, name
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                lines = node.end_lineno - node.lineno + 1
                assert lines <= LONGEST_FUNCTION, f"{name}: {node.name} has {lines} lines"
