# SPDX-License-Identifier: GPL-3.0-or-later
"""The node groups of a nodes preview, built one by one before it is switched on.

A file without a preview has none of them. They have more than three thousand nodes, and Blender updates a
whole group at each node and link: building them takes longer than evaluating them.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ..generated_collection import remove_unused_groups
from ..nodes.geometry_nodes import NAME_KEY, is_current
from ..remap.branch_nodes import every_branch_group, every_piece_group
from ..remap.divide_nodes import round_group
from ..remap.draft_nodes import draft_group
from ..remap.place_nodes import quick_place_group, sure_place_group
from ..remap.realize_nodes import realize_group
from ..remap.refine_nodes import refine_group
from ..remap.remap_nodes import preview_group
from ..table.table_branches import branches_group
from ..table.table_object import table_group_of
from .preview_members import shown_objects
from .preview_parts import face_count

# Seconds for building the groups, and for each million faces that a draft shows, by the clock on two cores.
BUILDING, DRAFT_BASE, DRAFT_SECONDS = 2.0, 0.05, 0.35


class Building:
    """The groups of a camera's preview, in the order of building; ``step`` makes the next one."""

    def __init__(self, camera):
        self._present = {group.session_uid for group in bpy.data.node_groups}
        self._steps = (
            quick_place_group,
            sure_place_group,
            realize_group,
            draft_group,
            round_group,
            refine_group,
            every_branch_group,
            every_piece_group,
            preview_group,
            branches_group,
        )
        self._camera = camera.name
        self._done = 0

    @property
    def progress(self) -> float:
        """The share of the groups that are built."""
        return self._done / (len(self._steps) + 1)

    def step(self) -> bool:
        """Build the next group; return whether there are more."""
        if self._done < len(self._steps):
            self._steps[self._done]()
            self._done += 1
            return True
        camera = bpy.data.objects.get(self._camera)
        if camera is not None and camera.scfpf.surfaces:
            table_group_of(camera)
        self._done += 1
        return False

    def give_up(self) -> None:
        """Remove what was built."""
        remove_unused_groups(
            [group for group in bpy.data.node_groups if group.session_uid not in self._present]
        )


def is_built() -> bool:
    """Return whether the file has the groups of the present build."""
    return any(is_current(group) and group.get(NAME_KEY) == "SCFPF Preview" for group in _groups())


def price(view_layer, depsgraph) -> str:
    """The cost of switching on a preview of a view layer, in words. depsgraph: its own, evaluated."""
    faces = sum(face_count(shown, depsgraph) for shown in shown_objects(view_layer).values())
    move = DRAFT_BASE + DRAFT_SECONDS * faces / 1e6
    begin = move * 3 + (0.0 if is_built() else BUILDING)
    return f"{faces:,} faces: about {begin:.1f} s to switch on, {move:.1f} s a move"


def _groups() -> Iterator:
    return (group for group in bpy.data.node_groups if group.bl_idname == "GeometryNodeTree")
