# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers, import circles, and names that must be unique. Sizes are a report: `python3 dev.py sizes`."""

import ast
import functools
import pathlib
import re
from graphlib import CycleError, TopologicalSorter

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[1]
# From the ground up: a layer may import those before it.
LAYERS = (
    *("projection", "casting", "aim", "shading", "anchors"),
    *("bridge", "scanline", "cycles", "engines", "farm", "operators", "panels"),
)
PURE = LAYERS[:5]
PRODUCT = ("scfpf_addon", "operators", "panels")


def is_code(path):
    """Return whether a file is part of the repository's code, not generated or installed."""
    parts = path.relative_to(ROOT).parts
    return not any(part.startswith(".") or part in ("dist", "build", "wheels", "output") for part in parts)


FILES = sorted(path for path in ROOT.rglob("*.py") if is_code(path))
MODULES = {path.relative_to(ROOT).with_suffix("").parts: path for path in FILES}
FOLDERS = sorted({path.parent for path in FILES})


def title(path):
    return path.relative_to(ROOT).as_posix()


@functools.cache
def parsed(path):
    """The syntax tree of a file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def statements(path):
    """Every statement of a file: their expressions, which are most of a tree, are passed over."""
    found, left = [], [parsed(path)]
    while left:
        node = left.pop()
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            left += getattr(node, field, ())
        found.append(node)
    return found


def is_product(path):
    return title(path).split("/")[0] in PRODUCT


@functools.cache
def imported(path):
    """The modules that a file imports, as tuples of names, type-only and local imports included."""
    package = path.relative_to(ROOT).with_suffix("").parts
    found = set()
    for node in statements(path):
        if isinstance(node, ast.Import):
            found |= {tuple(alias.name.split(".")) for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: -node.level] if node.level else ()
            start = (*base, *(node.module or "").split(".")) if node.module else base
            for alias in node.names:
                full = (*start, alias.name)
                found.add(full if full in MODULES or (*full, "__init__") in MODULES else start)
    return found - {()}


def layer_of(parts):
    """The layer of a module, None outside of the extension."""
    part = parts[1] if parts[0] == "scfpf_addon" and len(parts) > 2 else parts[0]
    return part if part in LAYERS else None


def test_the_page_names_what_there_is():
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    paths = set(re.findall(r"`([\w/.]+/[\w/.]*)`", page))
    assert len(paths) > 60
    for path in paths:
        assert (ROOT / path).exists() or (ROOT / "scfpf_addon" / path).exists(), f"there is no {path}"
    for folder in FOLDERS:
        name = title(folder).removeprefix("scfpf_addon/")
        if is_product(folder) and "/" in name and not name.startswith("operators/"):
            assert f"| `{name}` |" in page, f"the page has no row for {name}"


def test_arrows_point_one_way():
    for parts, path in MODULES.items():
        layer = layer_of(parts)
        if layer is None:
            continue
        allowed = LAYERS[: LAYERS.index(layer) + 1]
        for module in imported(path):
            other = module[1] if module[0] == "scfpf_addon" and len(module) > 1 else module[0]
            assert other not in LAYERS or other in allowed, f"{title(path)} imports {'.'.join(module)}"
            assert layer not in PURE or other not in ("bpy", "mathutils", "gpu"), title(path)


def entries_imported():
    """For each folder: what each of its entries, modules and folders, imports of the others."""
    graphs = {}
    for parts, path in MODULES.items():
        if parts[-1] == "__init__" or not is_product(path):
            continue
        for other in imported(path):
            if other not in MODULES or other == parts:
                continue
            same = next(n for n, pair in enumerate(zip(parts, other, strict=False)) if pair[0] != pair[1])
            graphs.setdefault(parts[:same], {}).setdefault(parts[same], set()).add(other[same])
    return graphs


def test_no_folder_has_an_import_circle():
    graphs = entries_imported()
    assert len(graphs) > 30
    for folder, graph in graphs.items():
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            pytest.fail(f"{'/'.join(folder)}: {' imports '.join(reversed(error.args[1]))}")


def test_tests_mirror_the_folders():
    """Each folder of tests for a package is named as one of its folders, or holds what concerns several."""
    for package in PURE:
        own = {path.name for path in (ROOT / "scfpf_addon" / package).iterdir() if path.is_dir()}
        for folder in (ROOT / "tests" / package).iterdir():
            if folder.is_dir() and folder.name != "__pycache__":
                assert folder.name in own | {"whole", "frame"}, title(folder)


def test_every_node_group_has_a_name_of_its_own():
    """A group is looked up by its name: two of one name would be taken for each other."""
    names = [
        node.args[0].value
        for path in FILES
        if is_product(path) and "defines_group" in path.read_text(encoding="utf-8")
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "defines_group"
    ]
    names += ["SCFPF Passes", "SCFPF Screen Surface"]  # of the compositor, and of Camera from Screen
    assert len(names) > 40
    assert sorted({name for name in names if names.count(name) > 1}) == []


def test_every_class_has_a_name_of_its_own():
    """A name in a traceback or a search leads to one class."""
    names = [
        node.name
        for path in FILES
        if is_product(path)
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ClassDef)
    ]
    assert len(names) > 400
    assert sorted({name for name in names if names.count(name) > 1}) == []
