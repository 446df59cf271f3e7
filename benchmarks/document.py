# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of benchmarks: looked at before any work; figures put into a document between two marks."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable
from pathlib import Path


def check_files(
    parser: argparse.ArgumentParser,
    *,
    read: str | Path | None = None,
    written: str | Path | None = None,
    document: str | Path | None = None,
    sections: Iterable[str] = (),
) -> None:
    """End the command with one line if a file cannot be used: call it before anything is measured.

    read: a file that must exist. written: a file that is created or replaced. document: a file whose
    ``sections`` are replaced. None: the option was not given.
    """
    if read and not Path(read).is_file():
        parser.error(f"there is no file {read}")
    if written:
        target = Path(written).absolute()
        place = target if target.exists() else target.parent
        if target.is_dir() or not place.exists() or not os.access(place, os.W_OK):
            parser.error(f"cannot write {written}: name a file in a folder that may be written to")
    if document:
        if Path(document).exists() and not os.access(document, os.W_OK):
            parser.error(f"cannot write {document}: it is read-only")
        try:
            text = Path(document).read_text(encoding="utf-8")
            for name in sections:
                _parted(document, text, name)
        except (OSError, ValueError) as error:
            parser.error(f"cannot put figures into {document}: {getattr(error, 'strerror', None) or error}")


def replace_section(path: str | Path, name: str, lines: list[str]) -> None:
    """Put ``lines`` between <!-- name --> and <!-- end of name --> in a file. ValueError without these."""
    before, after = _parted(path, Path(path).read_text(encoding="utf-8"), name)
    text = before + "\n".join(lines) + "\n" + after
    Path(path).write_text(text, encoding="utf-8", newline="\n")


def _parted(path: str | Path, document: str, name: str) -> tuple[str, str]:
    """The text up to a section's lines and the text after them, its marks included."""
    start, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    before, found, rest = document.partition(start)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{path} has no lines {start.strip()} and {end}: put them where the figures belong")
    return before + start, end + after
