# SPDX-License-Identifier: GPL-3.0-or-later
"""The price of a rig: of one that is there, or before it is made.

It is computed when a tooltip asks for it, in a fraction of a second.
"""

from __future__ import annotations

from typing import NamedTuple

from ..projection.user_error import UserError
from .chord_planning import chords_of
from .chords.chord_plan import ChordPlan, rendering_cost
from .portals.sheets import first_sheet, whole_vertices
from .watched_volume import look

# Memory of the sheets in Blender and in Cycles: 520 bytes a vertex, measured with 500,000.
BYTES_PER_VERTEX = 520

# By session ids of camera and scene: a signature of the volume, and the answer. Numbers and bytes only.
_answers: dict[tuple[int, int], tuple[tuple, Price | str]] = {}


class Price(NamedTuple):
    """The price of a rig: its chords, their error in pixels, the vertices of its sheets.

    passed: portals that a ray passes which skips empty chords, the mean; 0 if rays skip none.
    """

    chords: int
    error: float
    vertices: int
    passed: float = 0.0

    @property
    def portals(self) -> int:
        """The most portals that a ray passes: the screen, the sheets between chords, and the far sheet."""
        return self.chords + 1

    @property
    def cost(self) -> float:
        """Rendering time as a multiple of an ordinary camera's, in a simple scene."""
        return rendering_cost(self.passed - 1.0 if self.passed else self.chords)

    @property
    def memory(self) -> int:
        """The memory of the rig in bytes, approximately."""
        return self.vertices * BYTES_PER_VERTEX


def price_of_plan(plan: ChordPlan) -> Price:
    """The price of a planned rig."""
    return Price(plan.count, plan.error, whole_vertices(plan.count, plan.cells, plan.disc))


def price_of_rig(rig) -> Price:
    """The price of an existing rig."""
    settings = rig.scfpf_rig
    # Nodes repeat one sheet of the mesh, unless rays skip chords.
    vertices = len(settings.portals.data.vertices) - settings.sheet_vertices
    if not settings.passed:
        vertices = first_sheet(settings.chords) + (settings.chords + 1) * settings.sheet_vertices
    return Price(settings.chords, settings.error, vertices, settings.passed)


def forget() -> None:
    """Forget all prices, when another file is opened."""
    _answers.clear()


def compute(camera, scene, depsgraph) -> Price | str:
    """The price of a camera's rig in a scene at the present frame, or why it can have none.

    depsgraph: evaluated, of the scene.
    """
    key = camera.session_uid, scene.session_uid
    known, answer = _answers.get(key, ((), ""))
    signature: tuple = ()
    try:
        projection, signature = look(camera, scene, depsgraph)
        if signature != known:
            answer = price_of_plan(chords_of(camera, scene, [projection]))
    except UserError as error:
        answer = str(error)
    _answers[key] = signature, answer
    return answer
