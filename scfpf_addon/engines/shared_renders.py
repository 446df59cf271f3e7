# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders of anchors that further frames of an animation use again, in files."""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from ..anchors.anchor import Anchor
from ..shading.typing import Single


def mapped_to(path: str, values: Single) -> np.memmap:
    """Move values into a file that the system maps into memory as needed, for renders are many."""
    mapped = np.memmap(path, values.dtype, "w+", shape=values.shape)
    mapped[:] = values
    return mapped


class RenderKey(NamedTuple):
    """What a render depends on in a scene that stands still.

    part, has_halo: the image layer that is shown. has_strokes: whether Grease Pencil is. is_world: whether
    the world alone is.
    """

    matrix: bytes
    view: tuple
    part: int
    has_halo: bool
    has_strokes: bool
    is_world: bool

    @classmethod
    def of(cls, anchor: Anchor, part: int, has_halo: bool, has_strokes: bool, is_world: bool) -> RenderKey:
        """The key of an anchor's render."""
        view = anchor.window, anchor.size, anchor.start, anchor.end, anchor.is_parallel
        return cls(anchor.matrix.tobytes(), view, part, has_halo, has_strokes, is_world)


class Rendered(NamedTuple):
    """A render of an anchor: colors and passes (H, W, C), and depths (H, W), or None. Both are in files."""

    color: np.memmap
    depth: np.memmap | None


class SharedRenders:
    """The renders of the present frame and of the one before it. Call ``remove`` in any case."""

    def __init__(self) -> None:
        self._folder = tempfile.mkdtemp(prefix="scfpf-")
        self._known: dict[RenderKey, Rendered] = {}
        self._used: set[RenderKey] = set()
        self._count = 0

    def begin_frame(self) -> None:
        """Forget what the frame before did not use."""
        for key in [key for key in self._known if key not in self._used]:
            for values in filter(lambda values: values is not None, self._known.pop(key)):
                # Some systems keep files that are mapped: these go with the folder.
                with suppress(OSError):
                    os.remove(values.filename)
        self._used.clear()

    def find(self, key: RenderKey) -> Rendered | None:
        """An earlier render, or None."""
        self._used.add(key)
        return self._known.get(key)

    def keep(self, key: RenderKey, color: Single, depth: Single | None) -> Rendered:
        """Keep a render."""
        self._known[key] = Rendered(self._mapped(color), None if depth is None else self._mapped(depth))
        return self._known[key]

    def _mapped(self, values: Single) -> np.memmap:
        self._count += 1
        return mapped_to(os.path.join(self._folder, str(self._count)), values)

    def remove(self) -> None:
        """Remove the files."""
        self._known.clear()
        shutil.rmtree(self._folder, ignore_errors=True)
