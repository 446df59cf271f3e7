# SPDX-License-Identifier: GPL-3.0-or-later
"""The node groups of the live preview: what a flexible camera sees, as geometry in its viewbox.

The viewbox stands in the camera's space: x from -½ to ½ across the picture, y
from -½/aspect to ½/aspect up it, z from -1 (near surface) to -2 (far surface). An
orthographic camera that is a child of the flexible one with the identity as
its local matrix, sensor fit HORIZONTAL, ortho scale 1 and clip range 1 to 2 frames it exactly.
"""

from __future__ import annotations

from .table_object import table_object

__all__ = ["preview_group", "remap_counts", "remap_group", "table_object"]


def remap_group():
    """The node group "SCFPF Remap": geometry → what the camera of a table sees of it, in the viewbox.

    Inputs: Geometry, Table (Object, of ``table_object``), Aspect (width / height of the picture),
    Pixel Error, Picture Width (pixels). Usable in any modifier stack: positions are
    taken from the modified object's space, the viewbox stands in the table's. Found in the file or built.
    """
    raise NotImplementedError


def preview_group(camera):
    """The node group of the camera's whole preview: Collection → viewbox geometry.

    Inputs: Collection, Table (Object), Aspect, Pixel Error, Picture Width. The object that carries it must be a
    child of the camera with the identity as its local matrix, and in none of the collections that it shows.
    """
    raise NotImplementedError


def remap_counts(evaluated_object) -> dict[str, int]:
    """What an evaluated object's remap left out.

    Keys: ``unreachable`` (faces removed because a corner has no place in the volume), ``folded``
    (faces that stand where the volume is turned inside out). Zero where there is no remap.
    """
    raise NotImplementedError
