# SPDX-License-Identifier: GPL-3.0-or-later
"""The targets of a camera and the scene as arrays: what the solver and the judge of Aim take."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...aim.aim_scene import AimScene, HitFinder
from ...aim.solver.problem import AimLines, AimPins, AimProblem, AimStays
from ...aim.solver.start import projection_of
from ...aim.stays import find_stays
from ...aim.views import AimView, pins_on, seen_of
from ...casting.common.hits import CastError
from ...projection.typing import Array, BoolArray
from ...projection.user_error import UserError
from ...projection.volume.inverse import find_in_image
from ...projection.volume.viewing_volume import Projection
from ..blender.image_masks import mask_pixels, values_at
from ..blender.scene_objects import is_absent
from ..blender.slot_animation import MAPPINGS, SURFACES, require_own_items
from ..camera.read_projection import read_projection, world_to_camera
from ..live.kept_scene import KeptScene
from ..live.live_objects import LiveObjects
from ..render.image_size import image_aspect, image_size
from ..settings.aim_properties import LINE, PIN, STAY, VIEW
from .aimed_volume import Patches, fits, moved, new_start, start_of
from .target_views import target_objects, title_of, view_map

# The weight of a point of a locked region, compared with one of the background. They are fewer to the place.
LOCKED = 12.0
# Positions across and up the image at which locked regions are looked for.
LOCKED_GRID = (96, 54)
# The volume ends at this multiple of the scene's distance.
FAR_MARGIN = 1.05
# Positions along each side of the image at which that distance is measured.
FAR_SAMPLES = 5


@dataclass(frozen=True)
class SceneArrays:
    """The scene that is aimed in. names: full names of an object and its instancer, by object number."""

    scene: AimScene
    names: tuple[tuple[str, str], ...]

    def triangles_of(self, objects: list) -> BoolArray:
        """The mask (T,) of the triangles of Blender objects."""
        wanted = {obj.name_full for obj in objects}
        numbers = [n for n, names in enumerate(self.names) if not wanted.isdisjoint(names)]
        return self.scene.triangles_of(np.array(numbers, np.int64))

    def name(self, number: int) -> str:
        """The name of an object by its number."""
        return self.names[number][0]


@dataclass(frozen=True)
class Targets:
    """The pins of all targets. owners: (P,), the place of each pin's target in the list. halos: (P,), in
    world units. wanted: (T,), the triangles of things that views show. views: by their places in the list."""

    pins: AimPins
    owners: Array
    halos: Array
    lines: AimLines
    wanted: BoolArray
    alone: bool
    views: dict[int, AimView]


@dataclass(frozen=True)
class AimInputs:
    """The inputs of a solution, in world space.

    start: the patches of the volume before the first solution. present: the projection as it is. error: by
    how many pixels the start differs from a volume that it replaces. inward: (4, 4), to camera space.
    background: what stays around the targets, None if anything may move. locked: the regions of stays, by
    their places in the list.
    """

    arrays: SceneArrays
    targets: Targets
    start: Patches
    present: Projection
    background: AimStays | None
    locked: dict[int, AimStays]
    error: float
    inward: Array
    width: int

    @property
    def before(self) -> Projection:
        """The projection of the start."""
        return projection_of(self.start, self.present.aspect)

    def problem(self) -> AimProblem:
        """The problem of the solver."""
        targets = self.targets
        stays = (*(() if self.background is None else (self.background,)), *self.locked.values())
        return AimProblem(
            patches=self.start,
            width=self.width,
            aspect=self.present.aspect,
            pins=targets.pins,
            stays=tuple(stay for stay in stays if (stay.weights > 0.0).any()),
            lines=targets.lines,
            first_hits=HitFinder(self.arrays.scene, targets.wanted),
        )


def read_arrays(depsgraph) -> SceneArrays:
    """The objects that viewports and renders show. Raises UserError, CastError or UserError."""
    objects = LiveObjects()
    built = KeptScene().updated(objects.read(depsgraph))
    if built.cast_scene is None or built.tables is None:
        raise UserError("There is nothing to aim at: add an object with faces that renders show")
    names = tuple((key.name, key.owner_name) for key in objects.table.objects)
    return SceneArrays(AimScene(built.cast_scene, built.tables.object), names)


def read_targets(camera, depsgraph, arrays: SceneArrays, aspect: float) -> Targets:
    """The camera's views, pins and lines that are in use. Raises UserError, CastError or UserError."""
    parts, owners, halos = [], [], []
    wanted = np.zeros(len(arrays.scene.objects), bool)
    by_handle: dict[int, int] = {}
    views: dict[int, AimView] = {}
    listed = [(n, t) for n, t in enumerate(camera.scfpf.aim_targets) if t.is_on and t.weight > 0.0]
    for number, target in listed:
        if target.kind == VIEW:
            part, views[number] = _view_pins(target, number, depsgraph, arrays, aspect)
            wanted |= views[number].own
        elif target.kind == PIN:
            part = own_pin(target, depsgraph)
            by_handle[target.handle.session_uid] = sum(p.count for p in parts)
        else:
            continue
        parts.append(part)
        owners += [number] * part.count
        halos += [target.halo] * part.count
    if not parts:
        raise UserError(
            "'{0}' has no view and no pin to aim at: add one with Add View or Add Pin", camera.name
        )
    lines = [_line(target, by_handle) for _, target in listed if target.kind == LINE]
    alone = any(target.alone for _, target in listed if target.kind == VIEW)
    return Targets(
        AimPins.joined(parts),
        np.array(owners, np.int64),
        np.array(halos, np.float64),
        AimLines(np.array(lines, np.int64).reshape(-1, 2).T),
        wanted,
        alone,
        views,
    )


def _view_pins(target, number: int, depsgraph, arrays: SceneArrays, aspect: float) -> tuple[AimPins, AimView]:
    """The pins of a view, and where it shows what."""
    shown = view_map(target, depsgraph, aspect)
    own = arrays.triangles_of(target_objects(target))
    if not own.any():
        raise UserError(
            "The view '{0}' has no faces that viewports and renders show: show it", title_of(target)
        )
    try:
        seen = seen_of(arrays.scene, own, shown)
    except CastError as error:
        raise UserError(
            "'{0}' does not see '{1}': turn it there", target.eye.name, title_of(target)
        ) from error
    pins = pins_on(arrays.scene, seen, shown, number)
    pins = replace(pins, weights=pins.weights * target.weight)
    inside = ((pins.positions >= 0.0) & (pins.positions <= 1.0)).all(axis=0)
    if not inside.any():
        raise UserError("The view '{0}' is outside the picture: move its frame into it", title_of(target))
    return pins.take(inside), AimView(shown, own, seen)


def own_pin(target, depsgraph) -> AimPins:
    """The pin of an empty."""
    handle = target.handle
    if handle is None or is_absent(handle, depsgraph.scene):
        raise UserError("The pin '{0}' has no handle: remove it from the list", title_of(target))
    position = np.array(target.position, np.float64)[:, None]
    if not ((position >= 0.0) & (position <= 1.0)).all():
        raise UserError("The pin '{0}' is outside the picture: move it into it", title_of(target))
    matrix = np.array(handle.evaluated_get(depsgraph).matrix_world, np.float64)
    direction = -matrix[:3, 2:3] / max(float(np.linalg.norm(matrix[:3, 2])), 1e-300)
    return AimPins(
        points=matrix[:3, 3:].copy(),
        positions=position,
        directions=direction if target.use_direction else np.full((3, 1), np.nan),
        weights=np.array([target.weight]),
    )


def _line(target, by_handle: dict[int, int]) -> tuple[int, int]:
    ends = [by_handle.get(end.session_uid) if end else None for end in (target.first, target.second)]
    if ends[0] is None or ends[1] is None or ends[0] == ends[1]:
        raise UserError(
            "The line '{0}' needs two pins that are in use: choose their handles", title_of(target)
        )
    return ends[0], ends[1]


def read_inputs(camera, depsgraph, kept: Patches | None = None) -> AimInputs:
    """Read the inputs of a solution of a camera's targets. Raises USER_ERRORS.

    kept: the start in camera space, by default that of the camera's present volume.
    """
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    scene = depsgraph.scene
    width, aspect = image_size(scene)[0], image_aspect(scene)
    present = read_projection(camera, depsgraph, aspect)
    inward = world_to_camera(camera.evaluated_get(depsgraph))
    arrays = read_arrays(depsgraph)
    targets = read_targets(camera, depsgraph, arrays, aspect)
    kept, settings, error = kept or start_of(camera), camera.scfpf.aim, 0.0
    if kept is not None:
        start = moved(kept, np.linalg.inv(inward))
        if not fits(start, settings):
            start, error = new_start(projection_of(start, aspect), width, settings, None, 1.0)
    else:
        subject, far = _depths(present, targets, arrays.scene)
        start, error = new_start(present, width, settings, subject, far)
    before = projection_of(start, aspect)
    pins, background = targets.pins, None
    if not targets.alone:
        background = find_stays(before, arrays.scene, pins, targets.halos, targets.wanted, width)
    locked = _locked(camera, before, arrays, targets, width)
    return AimInputs(arrays, targets, start, present, background, locked, error, inward, width)


def _depths(present: Projection, targets: Targets, scene: AimScene) -> tuple[float | None, float]:
    """The t of the targets and of the end of scene and pins on straight projectors; None and 1 on others."""
    if not present.volume.spans.is_straight:
        return None, 1.0
    place = find_in_image(present, targets.pins.points)
    subject = float(np.median(place.t[place.found])) if place.found.any() else None
    line = np.linspace(0.0, 1.0, FAR_SAMPLES)
    x, y = (a.ravel() for a in np.meshgrid(line, line))
    points, valid = present.projectors(x, y)
    vertices = scene.world(scene.cast.vertices)
    centre = (vertices.min(axis=1) + vertices.max(axis=1)) / 2
    radius = float(np.linalg.norm(np.ptp(vertices, axis=1))) / 2
    away = np.linalg.norm(points[0] - centre[:, None], axis=0) + radius
    length = np.linalg.norm(points[1] - points[0], axis=0)
    valid &= length > 0.0
    far = float((away[valid] / length[valid]).max(initial=0.0))
    far = FAR_MARGIN * max(far, float(place.t[place.found].max(initial=0.0)))
    return subject, min(far, 1.0) if far > 0.0 else 1.0


def _locked(
    camera, before: Projection, arrays: SceneArrays, targets: Targets, width: int
) -> dict[int, AimStays]:
    """The regions of the stays that are in use, by their places in the list."""
    pins, wanted = targets.pins, targets.wanted
    found_by: dict[int, AimStays] = {}
    for number, target in enumerate(camera.scfpf.aim_targets):
        if target.kind != STAY or not target.is_on:
            continue
        free, objects = wanted, target_objects(target)
        if objects:
            free = wanted | ~arrays.triangles_of(objects)
        elif target.mask is None:
            raise UserError(
                "The stay '{0}' is empty: choose a collection, an object or a mask", title_of(target)
            )
        found = find_stays(before, arrays.scene, pins, np.zeros(pins.count), free, width, LOCKED_GRID)
        weights = found.weights * LOCKED * target.weight
        if target.mask is not None:
            places = np.stack(np.meshgrid(found.x, found.y, indexing="ij")).reshape(2, -1)
            weights = weights * _mask_values(target.mask, places).reshape(weights.shape)
        found_by[number] = replace(found, weights=weights)
    return found_by


def _mask_values(image, positions: Array) -> Array:
    """The first channel of an image at positions (2, N), (N,)."""
    pixels = mask_pixels(image)
    if pixels is None:
        raise UserError("The mask '{0}' has no pixels: load or paint it", image.name)
    return values_at(pixels, positions)
