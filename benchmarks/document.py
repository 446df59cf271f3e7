# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures put into a document, between two marks, in place of those of the last time."""

from __future__ import annotations

from pathlib import Path


def replace_section(path: str | Path, name: str, lines: list[str]) -> None:
    """Put ``lines`` between <!-- name --> and <!-- end of name --> in a file. ValueError without these."""
    document = Path(path).read_text(encoding="utf-8")
    start, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    before, found, rest = document.partition(start)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{path} has no lines {start.strip()} and {end}: put them where the figures belong")
    text = before + start + "\n".join(lines) + "\n" + end + after
    Path(path).write_text(text, encoding="utf-8", newline="\n")
