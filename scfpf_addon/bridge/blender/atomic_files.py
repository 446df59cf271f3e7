# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are written completely or not at all. The extension writes all its files by these functions."""

from __future__ import annotations

import os
import shutil
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from typing import BinaryIO

# Bytes of a file that are read at once.
BLOCK = 1 << 20
# Tags of a TIFF directory (TIFF 6.0, section 8), and bytes of a number by its type: SHORT, LONG.
STRIP_OFFSETS, STRIP_BYTES = 273, 279
TIFF_NUMBERS = {3: "H", 4: "I"}


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a new, empty file in the folder of ``path`` that replaces ``path`` at the end of the block.

    If the block or the system raises, the new file is removed and ``path`` stays unchanged. The new file's
    name is random and did not exist before: no other file is overwritten, and no symbolic link is followed.
    A symbolic link at ``path`` itself is replaced. Raises OSError.
    """
    part = _new_file(path)
    try:
        yield part
        # The error of a full disk may occur only when the system writes its buffers.
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        if path.exists():
            shutil.copymode(path, part)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def require_writable(path: Path) -> None:
    """Raise OSError if ``replacing`` could not write a file at ``path``."""
    # Raises for a name that is too long.
    with suppress(FileNotFoundError):
        path.lstat()
    _new_file(path).unlink()


def _new_file(path: Path) -> Path:
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    while True:
        part = path.with_name(f".{token_hex(8)}{path.suffix}")
        try:
            os.close(os.open(part, flags, 0o666))
        except FileExistsError:
            continue
        return part


def reserve(path: Path, size: int) -> None:
    """Raise OSError if the disk has no room for ``size`` bytes at ``path``, whose content is overwritten."""
    with path.open("wb") as file:
        for start in range(0, size, BLOCK):
            file.write(bytes(min(BLOCK, size - start)))
        file.flush()
        os.fsync(file.fileno())


def is_complete_image(path: Path) -> bool:
    """Return whether an image file is complete: False for one that a full disk has cut off.

    The format follows from the file's suffix. PNG, JPEG, TIFF and WebP are checked by their structure, with a
    few reads. Any other file must not be empty: Blender reports an EXR that it could not write. The pixels
    are not decoded, which would take as much memory again.
    """
    ending = path.suffix.lower()
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            if ending == ".png":
                return _is_whole_png(file)
            start = file.read(12)
            if ending in (".jpg", ".jpeg"):
                file.seek(max(size - 2, 2))
                return start[:2] == b"\xff\xd8" and file.read() == b"\xff\xd9"
            if ending == ".webp":
                return start[:4] == b"RIFF" and struct.unpack("<I", start[4:8])[0] + 8 == size
            if ending in (".tif", ".tiff"):
                return _is_whole_tiff(file, size, "<" if start[:2] == b"II" else ">")
    except (FileNotFoundError, ValueError, struct.error):
        return False
    return size > 0


def _is_whole_png(file: BinaryIO) -> bool:
    """Return whether a PNG has all chunks, each with its correct checksum (RFC 2083)."""
    if file.read(8) != b"\x89PNG\r\n\x1a\n":
        return False
    while True:
        length, kind = struct.unpack(">I4s", file.read(8))
        found, left = zlib.crc32(kind), length
        while left and (block := file.read(min(left, BLOCK))):
            found, left = zlib.crc32(block, found), left - len(block)
        if struct.unpack(">I", file.read(4))[0] != found:
            return False
        if kind == b"IEND":
            return True


def _is_whole_tiff(file: BinaryIO, size: int, order: str) -> bool:
    """Return whether the first directory of a TIFF and its strips lie inside the file."""

    def numbers(form: str) -> tuple[int, ...]:
        form = order + form
        return struct.unpack(form, file.read(struct.calcsize(form)))

    file.seek(4)
    file.seek(numbers("I")[0])
    strips: dict[int, tuple[int, ...]] = {}
    entries = [numbers("HHI4s") for _ in range(numbers("H")[0])]
    for tag, kind, count, inline in entries:
        if tag in (STRIP_OFFSETS, STRIP_BYTES) and kind in TIFF_NUMBERS and count <= size:
            form = f"{count}{TIFF_NUMBERS[kind]}"
            if struct.calcsize(order + form) > 4:
                file.seek(struct.unpack(order + "I", inline)[0])
                strips[tag] = numbers(form)
            else:
                strips[tag] = struct.unpack_from(order + form, inline)
    ends = map(sum, zip(strips.get(STRIP_OFFSETS, ()), strips.get(STRIP_BYTES, ()), strict=True))
    return 0 < max(ends, default=0) <= size
