# SPDX-License-Identifier: GPL-3.0-or-later
"""The anchors of an animation: planned for some frames together, kept from frame to frame, faded in and out.

Anchors that stand still show surfaces that stand still alike in all frames. Where some frames end, those
before and those after are mixed for a while. Each frame of a volume that sees from one point has anchors of
its own instead, which move with that point.

A frame has the same anchors whichever frames are rendered, and in whatever order: farms render them apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection
from .anchor import Anchor
from .anchor_view import AnchorView, ViewSet, traced_views, without_unused
from .completion import completed, looked_through
from .kept_plan import KeptPlan
from .plan import PlanLimits, have_one_eye, plan_anchors
from .seen_scene import SeenScene

# Frames that are planned together, and those after a change of anchors in which both are mixed.
TOGETHER, FADE = 16, 9


@dataclass(frozen=True)
class AnchorSet:
    """The anchors of some frames. rest: those for what the first ones turned out not to show. share: of the
    set in a frame's picture."""

    anchors: list[Anchor]
    rest: list[Anchor] = field(default_factory=list)
    share: float = 1.0


@dataclass(frozen=True)
class LookedAt:
    """A frame that a chunk is planned for. made_for: the digest of what its plan depends on."""

    scene: SeenScene
    projection: Projection
    made_for: str


class Shot:
    """The anchors of a shot, in chunks of frames, which begin at multiples of TOGETHER.

    Chunks of even numbers are planned alone, the others with the anchors of both neighbours at hand. So a
    frame takes the plans of three chunks at most, and neighbours share anchors.
    """

    def __init__(self, first: int, last: int, step: int = 1, layer: int = 0) -> None:
        """first, last: the frames of the whole shot, few of which may be rendered. step: between two. layer:
        the number of the image layer that is planned, 0 for the rest."""
        self._ends, self._step, self._layer = (first, last), step, layer
        # By chunk; None if each frame has anchors of its own.
        self._sets: dict[int, AnchorSet | None] = {}
        self._made_for: dict[int, tuple[str, ...]] = {}

    def missing(self, frame: int) -> list[int]:
        """The chunks that are to be planned for a frame, in this order."""
        own = self._chunk(frame)
        wanted = [own]
        if self._begun(frame) < FADE:
            wanted += [chunk for chunk in self._neighbours(own) if chunk < own]
        for chunk in wanted[:]:
            wanted += self._neighbours(chunk) if chunk % 2 else []
        evens_first = sorted(set(wanted), key=lambda chunk: (chunk % 2, chunk))
        return [chunk for chunk in evens_first if chunk not in self._sets]

    def frames(self, chunk: int) -> list[int]:
        """The frames to plan a chunk for: its first, middle and last one within the shot."""
        first, last = self._frames_of(chunk)
        if self._is_within(chunk):
            first, last = max(first, self._ends[0]), min(last, self._ends[1])
        return sorted({first, (first + last) // 2, last})

    def plan(
        self,
        chunk: int,
        looked_at: Sequence[LookedAt],
        size: tuple[int, int],
        axes: Array,
        limits: PlanLimits | None = None,
        kept: KeptPlan | None = None,
        threads: int = 0,
    ) -> None:
        """Plan a chunk, the first one that ``missing`` names.

        looked_at: its ``frames``. size, axes, limits: as for ``plan_anchors``. kept: a plan, taken if it was
        made for all that is looked at. Raises CastError and Cancelled.
        """
        different = {each.made_for: each for each in looked_at}
        made_for = tuple(different)
        self._sets[chunk] = self._planned(
            chunk, [*different.values()], size, axes, limits or PlanLimits(), kept, threads
        )
        self._made_for[chunk] = made_for

    def _planned(
        self,
        chunk: int,
        looked_at: list[LookedAt],
        size: tuple[int, int],
        axes: Array,
        limits: PlanLimits,
        kept: KeptPlan | None,
        threads: int,
    ) -> AnchorSet | None:
        made_for = tuple(each.made_for for each in looked_at)
        # Where nothing moves all chunks have one set. Of the odd ones only neighbours know.
        known = self._neighbours(chunk) if chunk % 2 else [other for other in self._sets if other % 2 == 0]
        known = [other for other in known if other in self._sets]
        for other in known:
            if self._made_for[other] == made_for:
                return self._sets[other]
        if kept is not None and made_for == (kept.made_for,):
            is_alone = kept.is_one_eye and not self._layer
            return None if is_alone else AnchorSet([*kept.of_layer(self._layer)])
        scenes, projections = (
            [getattr(each, name) for each in looked_at] for name in ("scene", "projection")
        )
        if have_one_eye(scenes, projections, size):
            return None
        beside = [self._sets[other] for other in known] if chunk % 2 else []
        anchors = {id(each): each for own in beside if own is not None for each in own.anchors}
        plan = plan_anchors(
            scenes, projections, size, axes, limits, [*anchors.values()], things_only=self._layer > 0
        )
        return self._with_rest([*plan.anchors], looked_at, size, limits, threads)

    def _with_rest(
        self,
        anchors: list[Anchor],
        looked_at: Sequence[LookedAt],
        size: tuple[int, int],
        limits: PlanLimits,
        threads: int,
    ) -> AnchorSet:
        """The set of anchors, with further ones for all pixels of the frames looked at."""
        rest: list[Anchor] = []
        for each in looked_at:
            views = traced_views(each.scene, [*anchors, *rest], threads)
            numbers = range(len(views))
            own = ViewSet(tuple(numbers[: len(anchors)]), tuple(numbers[len(anchors) :]))
            done = completed(each.scene, each.projection, size, views, own, limits, threads)
            rest += done.added
        return AnchorSet(anchors, rest)

    def sets(self, frame: int) -> list[AnchorSet]:
        """The sets of anchors of a frame, the present one last; [] if it is planned by itself."""
        chunk = self._chunk(frame)
        own = self._sets.get(chunk)
        if own is None:
            return []
        share = min((self._begun(frame) + 1) / (FADE + 1), 1.0)
        before = self._sets.get(chunk - 1) if chunk - 1 in self._neighbours(chunk) else None
        if before is None or before is own or share == 1.0:
            return [own]
        return [replace(before, share=1.0 - share), replace(own, share=share)]

    def _chunk(self, frame: int) -> int:
        return frame // (TOGETHER * self._step)

    def _begun(self, frame: int) -> int:
        """The number of the chunk's frames before a frame."""
        return frame % (TOGETHER * self._step) // self._step

    def _frames_of(self, chunk: int) -> tuple[int, int]:
        length = TOGETHER * self._step
        return chunk * length, (chunk + 1) * length - 1

    def _is_within(self, chunk: int) -> bool:
        """Return whether a chunk has frames of the shot."""
        first, last = self._frames_of(chunk)
        return first <= self._ends[1] and last >= self._ends[0]

    def _neighbours(self, chunk: int) -> list[int]:
        """The chunks before and after one. Those of the shot have none beyond it."""
        both = chunk - 1, chunk + 1
        return [each for each in both if self._is_within(each) or not self._is_within(chunk)]


class LayeredShot:
    """The anchors of a shot whose image may have layers."""

    def __init__(self, first: int, last: int, step: int = 1) -> None:
        """See ``Shot``."""
        self._frames = first, last, step
        self._rest = Shot(*self._frames)
        self._shots = {0: self._rest}

    def missing(self, frame: int) -> list[int]:
        """The chunks that are to be planned for a frame, in this order."""
        return self._rest.missing(frame)

    def frames(self, chunk: int) -> list[int]:
        """The frames to plan a chunk for."""
        return self._rest.frames(chunk)

    def plan(
        self,
        chunk: int,
        looked_at: Sequence[Mapping[int, LookedAt]],
        size: tuple[int, int],
        axes: Array,
        limits: PlanLimits | None = None,
        kept: KeptPlan | None = None,
        threads: int = 0,
    ) -> None:
        """Plan a chunk. looked_at: of each frame, by the number of the layer; the rest see ``Shot.plan``."""
        for number in sorted({number for each in looked_at for number in each}):
            shot = self._shots.setdefault(number, Shot(*self._frames, number))
            there = [each[number] for each in looked_at if number in each]
            shot.plan(chunk, there, size, axes, limits, kept, threads)

    def sets(self, frame: int, number: int) -> list[AnchorSet]:
        """The sets of anchors of a layer, or of the rest for 0; see ``Shot.sets``."""
        return self._shots[number].sets(frame) if number in self._shots else []


def completed_sets(
    scene: SeenScene,
    projection: Projection,
    size: tuple[int, int],
    sets: Sequence[AnchorSet],
    limits: PlanLimits | None = None,
    threads: int = 0,
) -> tuple[list[AnchorView], list[ViewSet]]:
    """Trace the anchors of a frame's sets, add what the last set lacks, and leave out what shows nothing.

    Returns the views and their sets. Raises CastError and Cancelled.
    """
    anchors = {id(anchor): anchor for each in sets for anchor in (*each.anchors, *each.rest)}
    numbers = {key: number for number, key in enumerate(anchors)}
    views = traced_views(scene, list(anchors.values()), threads)
    first, rest = (
        [tuple(numbers[id(anchor)] for anchor in part) for part in parts]
        for parts in ([each.anchors for each in sets], [each.rest for each in sets])
    )
    of_views = [ViewSet(*each) for each in zip(first, rest, (own.share for own in sets), strict=True)]
    faded = [looked_through(scene, projection, size, views, own, threads)[2] for own in of_views[:-1]]
    done = completed(scene, projection, size, views, of_views[-1], limits, threads)
    return without_unused(done.views, [*faded, done.own])
