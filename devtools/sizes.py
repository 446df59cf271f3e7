# SPDX-License-Identifier: GPL-3.0-or-later
"""The largest folders, files, classes and functions of the checkout, for whoever judges them by eye."""

from __future__ import annotations

import ast
import pathlib
import subprocess
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from .environments import ROOT

SHOWN = 12  # rows of each table
PRODUCT = ("scfpf_addon", "operators", "panels")


class Size(NamedTuple):
    """A row of a table: a number of lines or of modules, and what has it."""

    number: int
    title: str


def files() -> list[pathlib.Path]:
    """The Python files that git knows, tests and tools included."""
    listed = subprocess.run(["git", "ls-files", "*.py"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]


def definitions(path: pathlib.Path) -> Iterator[tuple[bool, Size]]:
    """Each class and function of a file with its lines; the first value tells whether it is a class."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            place = f"{path.relative_to(ROOT).as_posix()}: {node.name}"
            yield isinstance(node, ast.ClassDef), Size(lines, place)


def tables(paths: list[pathlib.Path]) -> dict[str, list[Size]]:
    """The tables of the report by their titles, each sorted by size, the largest first."""
    names = {path: path.relative_to(ROOT).as_posix() for path in paths}
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in paths}
    found = [definition for path in paths for definition in definitions(path)]
    folders = Counter(names[path].rpartition("/")[0] or "." for path in paths if path.name != "__init__.py")
    rooms: Counter[str] = Counter()
    for path, number in lines.items():
        parts = names[path].split("/")
        rooms["/".join(parts[:2]) if parts[0] == "scfpf_addon" and len(parts) > 2 else parts[0]] += number
    product = [path for path in paths if names[path].split("/")[0] in PRODUCT and path.name != "__init__.py"]
    rows = {
        "lines of a room": [Size(number, room) for room, number in rooms.items() if not room.endswith(".py")],
        "modules of a folder": [Size(number, folder) for folder, number in folders.items()],
        "lines of a file": [Size(number, names[path]) for path, number in lines.items()],
        "lines of a class": [size for is_class, size in found if is_class],
        "lines of a function": [size for is_class, size in found if not is_class],
    }
    ranked = {title: sorted(sizes, key=lambda size: -size.number) for title, sizes in rows.items()}
    ranked["lines of the shortest modules"] = sorted(Size(lines[path], names[path]) for path in product)
    return ranked


def report() -> str:
    """The report as text: the total, then the first rows of each table."""
    paths = files()
    total = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)
    blocks = [f"{total:,} lines in {len(paths)} files"]
    for title, sizes in tables(paths).items():
        blocks.append("\n".join((f"\n{title}", *(f"{number:8,}  {name}" for number, name in sizes[:SHOWN]))))
    return "\n".join(blocks)
