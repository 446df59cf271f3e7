# SPDX-License-Identifier: GPL-3.0-or-later
"""The screenshots of the documents, taken in a Blender with a window, and the generated pages."""

from __future__ import annotations

import html
import json
import pathlib
import shutil
import time

from . import package, settings_page, window
from .environments import ROOT, Environment, Failure, say

FOLDER = ROOT / "docs" / "pictures"
PAGE = ROOT / "docs" / "presets.md"
# Files that are put beside the scenarios of tests/window for the run.
SCENARIOS = {"scenarios_guide.py": ROOT / "demo" / "guide_pictures.py"}
LARGEST_BYTES, LARGEST_MOVING_BYTES = 150_000, 2_000_000
LIMIT = 840.0  # seconds
HEAD = """# Presets

This page lists every projection of the menu *Projection Preset*. The [gallery](gallery.md) has larger
pictures of most of them. `python3 dev.py pictures` writes this page from the files in `presets/`.
"""


def take(environment: Environment, blender: str | None, names: list[str]) -> None:
    """Write the pages of presets and settings, and the screenshots in docs/pictures.

    blender: the path of the Blender to use, or None. names: scenarios of demo/guide_pictures.py, else all.
    """
    for page, text in ((PAGE, presets_page()), (settings_page.PAGE, settings_page.page())):
        page.write_text(text, encoding="utf-8")
        say(f"written {page.relative_to(ROOT)}")
    package.build(environment)
    deadline = time.monotonic() + LIMIT
    try:
        with window.place(blender, deadline) as found:
            beside = {**window.BESIDE, **SCENARIOS}
            results, warnings = window.run(found, names or ["scenarios_guide"], deadline, beside)
    except window.Unavailable as reason:
        raise Failure(f"the pictures need a Blender with a window: {reason}") from None
    if warnings or not all(result.ended_well for result in results):
        raise Failure(" ".join(warnings) or f"not all were taken; see {window.SHOTS.relative_to(ROOT)}")
    FOLDER.mkdir(exist_ok=True)
    for path in sorted(window.SHOTS.iterdir()):
        if path.suffix in (".png", ".jpg"):
            keep(path)


def keep(path: pathlib.Path) -> None:
    """Copy a screenshot into docs/pictures. Raises Failure if it is too large for a page."""
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        raise Failure(f"{path.name} has {size / 1000:.0f} kB; a picture may have {LARGEST_BYTES / 1000:.0f}")
    shutil.copy(path, FOLDER / path.name)
    say(f"written {(FOLDER / path.name).relative_to(ROOT)} ({size / 1000:.0f} kB)")


def presets_page() -> str:
    """The text of docs/presets.md: thumbnail, name and description of every preset, by the menu's groups."""
    groups: dict[str, list[tuple[str, str, str, str]]] = {}
    for path in (ROOT / "presets").glob("*.json"):
        preset = json.loads(path.read_text(encoding="utf-8"))
        entry = preset["name"], path.stem, preset["description"], preset["source"]
        groups.setdefault(preset["group"], []).append(entry)
    lines = [HEAD]
    for group in sorted(groups):
        lines += [f"## {group}", "", "| | preset | what it shows |", "|---|---|---|"]
        for name, stem, description, source in sorted(groups[group]):
            picture = f'<img src="../presets/thumbnails/{stem}.png" width="128" alt="{html.escape(name)}">'
            text = f"{description}<br><sub>{source}</sub>".replace("|", "\\|")
            lines.append(f"| {picture} | **{name}** | {text} |")
        lines.append("")
    return "\n".join(lines)
