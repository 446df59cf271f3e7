# SPDX-License-Identifier: GPL-3.0-or-later
"""The anchors of an animation: planned for some frames together, kept from frame to frame, faded in and out.

Anchors that stand still show surfaces that stand still alike in all frames. Where some frames end, those
before and those after are mixed for a while. Each frame of a volume that sees from one point has anchors of
its own instead, which move with that point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection
from .anchor import Anchor
from .anchor_view import AnchorView, ViewSet, traced_views, without_unused
from .completion import completed, looked_through
from .plan import PlanLimits, have_one_eye, plan_anchors
from .seen_scene import SeenScene

# Frames that are planned together, and those after a change of anchors in which both are mixed.
TOGETHER, FADE = 16, 9


@dataclass(frozen=True)
class AnchorSet:
    """The anchors of some frames. rest: those that frames turned out to need besides. share: of the set in a
    frame's picture."""

    anchors: list[Anchor]
    rest: list[Anchor] = field(default_factory=list)
    share: float = 1.0


class Shot:
    """The anchors of a shot of so many frames, which are rendered in their order; places count from 0."""

    def __init__(self, count: int, limits: PlanLimits | None = None) -> None:
        self._count, self._limits = count, limits or PlanLimits()
        self._begun, self._planned = 0, 0
        self._own: AnchorSet | None = None
        self._before: AnchorSet | None = None

    def needs(self, place: int) -> list[int]:
        """The places of the frames to plan for, [] if the frame of a place is planned for already."""
        if place < self._planned:
            return []
        last = min(place + TOGETHER, self._count) - 1
        return sorted({place, (place + last) // 2, last})

    def plan(
        self,
        place: int,
        scenes: Sequence[SeenScene],
        projections: Sequence[Projection],
        size: tuple[int, int],
        axes: Array,
    ) -> None:
        """Plan for the frames that ``needs`` names. See ``plan_anchors``. Raises CastError and Cancelled."""
        last = self.needs(place)[-1]
        own = None
        if not have_one_eye(scenes, projections, size):
            kept = self._own.anchors if self._own is not None else []
            plan = plan_anchors(scenes, projections, size, axes, self._limits, kept)
            own = AnchorSet([*plan.anchors])
        self._before, self._own, self._begun, self._planned = self._own, own, place, last + 1

    def sets(self, place: int) -> list[AnchorSet]:
        """The sets of anchors of a frame, the present one last; [] if it is planned by itself."""
        if self._own is None:
            return []
        share = min((place - self._begun + 1) / (FADE + 1), 1.0)
        if self._before is None or share == 1.0:
            return [replace(self._own, share=1.0)]
        return [replace(self._before, share=1.0 - share), replace(self._own, share=share)]

    def add(self, anchors: Sequence[Anchor]) -> None:
        """Keep further anchors that a frame turned out to need, as long as its set is there."""
        if self._own is not None:
            self._own.rest.extend(anchors)


def completed_sets(
    scene: SeenScene,
    projection: Projection,
    size: tuple[int, int],
    sets: Sequence[AnchorSet],
    threads: int = 0,
) -> tuple[list[AnchorView], list[ViewSet], tuple[Anchor, ...]]:
    """Trace the anchors of a frame's sets, add what the last set lacks, and leave out what shows nothing.

    Returns the views, their sets, and the further anchors. Raises CastError and Cancelled.
    """
    anchors = {id(anchor): anchor for each in sets for anchor in (*each.anchors, *each.rest)}
    numbers = {key: number for number, key in enumerate(anchors)}
    views = traced_views(scene, list(anchors.values()), threads)
    first, rest = (
        [tuple(numbers[id(anchor)] for anchor in part) for part in parts]
        for parts in ([each.anchors for each in sets], [each.rest for each in sets])
    )
    of_views = [ViewSet(*each) for each in zip(first, rest, (own.share for own in sets), strict=True)]
    limits = PlanLimits()
    faded = [looked_through(scene, projection, size, views, own, limits, threads)[2] for own in of_views[:-1]]
    done = completed(scene, projection, size, views, of_views[-1], limits, threads)
    return *without_unused(done.views, [*faded, done.own]), done.added
