# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages of the recipes, written from the steps that tests perform."""

from __future__ import annotations

import textwrap

from ..render_demo import ROOT
from .jobs import RECIPES
from .steps import Recipe

FOLDER = ROOT / "docs" / "recipes"
HEAD = """# Recipes

One page a job. Each has its picture, its steps, and a file that opens: `python3 dev.py recipes` writes
the pages, and `demo/output/recipes/` with a .blend of each. The steps are those that the tests perform.
"""


def page(recipe: Recipe) -> str:
    """The page of a recipe."""
    lines = [f"# {recipe.title}", "", f"![{recipe.title}]({recipe.stem}.jpg)", "", *wrapped(recipe.seek), ""]
    for number, step in enumerate(recipe.steps, 1):
        lines += wrapped(step.text, f"{number}. ")
    file = f"`python3 dev.py recipes {recipe.stem}` makes this as `demo/output/recipes/{recipe.stem}.blend`."
    ways = "[All recipes](README.md) · [Glossary](../glossary.md)"
    lines += ["", *wrapped(recipe.more), "", *wrapped(file), "", ways]
    return "\n".join([*lines, ""])


def wrapped(text: str, first: str = "") -> list[str]:
    """Lines of a paragraph, or of a point of a list."""
    return textwrap.wrap(
        text, 120, initial_indent=first, subsequent_indent=" " * len(first), break_on_hyphens=False
    )


def index() -> str:
    """The page of all recipes."""
    lines = [HEAD, "| | job |", "|---|---|"]
    for one in RECIPES:
        picture = f'<img src="{one.stem}.jpg" width="240" alt="{one.title}">'
        lines.append(f"| {picture} | **[{one.title}]({one.stem}.md)**<br>{one.seek} |")
    return "\n".join([*lines, ""])


def pages() -> dict[str, str]:
    """The text of every page by its file's name."""
    return {"README.md": index(), **{f"{recipe.stem}.md": page(recipe) for recipe in RECIPES}}


def write() -> None:
    """Write the pages."""
    FOLDER.mkdir(exist_ok=True)
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
