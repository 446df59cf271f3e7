# SPDX-License-Identifier: GPL-3.0-or-later
"""The look of a viewport's Solid shading, read for a live image."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import bpy
import numpy as np
from mathutils import Color

from ...projection.diagrams.line_colors import line_colors
from ...projection.typing import Array, IndexArray
from ...shading.live.background import Background, shown_as_overlay
from ...shading.live.cavity import Cavity
from ...shading.live.live_overlays import ACTIVE, SELECTED, Overlays
from ...shading.live.matcap import Matcap
from ...shading.live.solid_look import SolidLook, SurfaceLooks
from ...shading.live.studio_light import StudioLight
from ..settings.stylised_properties import stylised_of
from .live_images import ImageCache, ImageUse
from .live_objects import Attributes, LiveObjects, LookTable
from .read_lights import MatcapCache, read_studio_light
from .read_surfaces import (
    PLAIN_ROUGHNESS,
    MaterialLook,
    read_material_looks,
    read_object_values,
)

# Types of datablocks whose changes may change materials or images.
MATERIAL_TYPES = ("MATERIAL", "NODETREE", "TEXTURE")


def wanted_attributes(shading) -> Attributes:
    """The attributes of meshes that a viewport's colours may need."""
    kind = shading.color_type if shading.type == "SOLID" else "TEXTURE"
    return Attributes(kind == "TEXTURE" and len(bpy.data.images) > 0, kind == "VERTEX")


class Numbers(NamedTuple):
    """The rows of a table of looks as arrays of session_uids, each different one once.

    objects, materials: different ones; 0 is an empty slot. object_of_look, material_of_look: (L,) their
    numbers. owners: (O,) of each object the one that a click selects.
    """

    objects: IndexArray
    object_of_look: IndexArray
    materials: IndexArray
    material_of_look: IndexArray
    owners: IndexArray

    @classmethod
    def of(cls, table: LookTable) -> Numbers:
        """Read the materials in the slots of a table's objects."""
        uids = np.array([key.uid for key in table.objects], np.int64)
        objects, object_of_number = np.unique(uids, return_inverse=True)
        slots: dict[int, list[int]] = {uid: [] for uid in objects.tolist()}
        for obj in bpy.data.objects:
            if obj.session_uid in slots:
                used = (slot.material for slot in obj.material_slots)
                slots[obj.session_uid] = [one.session_uid if one else 0 for one in used]
        given = [
            found[slot] if slot < len(found := slots[table.objects[number].uid]) else 0
            for number, slot in zip(table.look_object, table.look_slot, strict=True)
        ]
        materials, material_of_look = np.unique(np.array(given, np.int64), return_inverse=True)
        owners = np.array([key.owner_uid for key in table.objects], np.int64)
        object_of_look = object_of_number[np.array(table.look_object, np.intp)]
        return cls(objects, object_of_look, materials, material_of_look, owners)


class LookReader:
    """Reads looks, and keeps what seldom changes: the values of materials, and images.

    It holds numbers and arrays, no Blender data.
    """

    def __init__(self) -> None:
        self._images = ImageCache()
        self._matcaps = MatcapCache()
        self._numbers: tuple[tuple, Numbers] | None = None
        # By session_uid, for each kind of colour: viewports may show materials in different ways.
        self._materials: dict[str, dict[int, MaterialLook]] = {}
        self.is_complete = True

    def mark_edited(self, depsgraph=None) -> None:
        """Note an update, None for any: materials and images are read again if it may have changed them."""
        if depsgraph is None or any(depsgraph.id_type_updated(kind) for kind in MATERIAL_TYPES):
            self._materials.clear()
        if depsgraph is None:
            self._numbers = None
        if depsgraph is None or depsgraph.id_type_updated("IMAGE"):
            self._images.mark_edited()

    def read(
        self,
        objects: LiveObjects,
        shading,
        overlay,
        depsgraph,
        camera=None,
        area: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0),
        width: float = 0.0,
    ) -> SolidLook:
        """Read a look of Solid or Material Preview, for objects that have been read.

        shading, overlay: bpy.types.View3DShading and View3DOverlay, None for no overlays. depsgraph: the
        viewport's. camera: evaluated, the one that the viewport looks through. area: left, bottom, right and
        top of the image in the viewport, as shares of it, for gradients. width: of the camera's frame there,
        in pixels, for the lines of Drawn Style; 0 for none. Afterwards ``is_complete`` is False
        while images or a matcap are still to be read: read again soon.
        """
        key = objects.edits, len(objects.table.look_object)
        if self._numbers is None or self._numbers[0] != key:
            self._numbers = key, Numbers.of(objects.table)
        numbers = self._numbers[1]
        surfaces, textures, waiting = self._surfaces(numbers, shading, depsgraph)
        light = self._light(shading)
        self.is_complete = not waiting and not self._matcaps.is_waiting
        background = _background(shading, depsgraph.scene, area)
        is_solid = shading.type == "SOLID"
        style = stylised_of(depsgraph.scene_eval, round(width)) if width else None
        return SolidLook(
            light=light,
            highlights=shading.show_specular_highlight or not is_solid,
            surfaces=surfaces,
            background=background,
            textures=textures,
            cavity=_cavity(shading) if is_solid and shading.show_cavity else None,
            overlays=_overlays(numbers, overlay, depsgraph.view_layer, background),
            lines=style and style.lines,
            camera_axes=None if camera is None else _axes(camera),
        )

    def _light(self, shading) -> StudioLight | Matcap | None:
        """The light of a viewport; None for flat colours."""
        lights = bpy.context.preferences.studio_lights
        if shading.type != "SOLID":
            # Its own light is an image of a world, which is not along projectors: the first studio.
            found = next((one for one in lights if one.type == "STUDIO"), None)
            return None if found is None else read_studio_light(found, False, 0.0)
        if shading.light == "FLAT":
            return None
        found = shading.selected_studio_light
        if shading.light == "MATCAP":
            matcap = self._matcaps.matcap(found.path)
            if matcap is not None:
                return matcap
            found = next((one for one in lights if one.type == "STUDIO"), found)
        return read_studio_light(found, shading.use_world_space_lighting, shading.studiolight_rotate_z)

    def _surfaces(self, numbers: Numbers, shading, depsgraph):
        """The surfaces of a table by the viewport's colour setting, their images, and how many wait."""
        kind = shading.color_type if shading.type == "SOLID" else "NODES"
        if kind in {"TEXTURE", "NODES"}:
            return self._by_material(numbers, kind, depsgraph)
        if kind == "MATERIAL":
            return self._by_material(numbers, "VIEWPORT", depsgraph)
        if kind == "VERTEX":
            # Blender shows the material of meshes without the attribute.
            made = self._by_material(numbers, "VIEWPORT", depsgraph)[0]
            has_color = read_object_values(numbers.objects, depsgraph, False).has_color[
                numbers.object_of_look
            ]
            plain = np.where(has_color, np.float32(PLAIN_ROUGHNESS), made.roughness)
            metallic, alpha = np.where(has_color, 0, made.metallic), np.where(has_color, 1, made.alpha)
            made = replace(made, roughness=plain, metallic=metallic, alpha=alpha.astype(np.float32))
            return replace(made, uses_attribute=has_color), None, 0
        count = len(numbers.object_of_look)
        color = np.ones((count, 4), np.float32)
        if kind == "SINGLE":
            color[:, :3] = shading.single_color
        else:
            found = read_object_values(numbers.objects, depsgraph, kind == "RANDOM")
            color = found.color[numbers.object_of_look]
        plain = np.full(count, PLAIN_ROUGHNESS, np.float32)
        return _looks(color, np.zeros(count, np.float32), plain), None, 0

    def _by_material(self, numbers: Numbers, kind: str, depsgraph):
        """The surfaces by their materials; see ``read_material_looks`` for the kinds."""
        uids, known = numbers.materials.tolist(), self._materials.setdefault(kind, {})
        if unknown := set(uids) - known.keys():
            known |= read_material_looks(unknown, kind)
        materials = [known[uid] for uid in uids]
        values = np.nan_to_num(np.array([one.values for one in materials], np.float32).reshape(-1, 6))
        values = values[numbers.material_of_look]
        made = _looks(values[:, :4], values[:, 4], values[:, 5])
        uses: tuple[ImageUse, ...] = tuple(one.image for one in materials if one.image is not None)
        if not uses:
            return made, None, 0
        textures, rows, waiting = self._images.textures(uses, bpy.data.images)
        given = iter(rows)
        of_material = np.array([-1 if one.image is None else next(given) for one in materials])
        has_uv = read_object_values(numbers.objects, depsgraph, False).has_uv
        image = np.where(has_uv[numbers.object_of_look], of_material[numbers.material_of_look], -1)
        return replace(made, image=image), textures, waiting


def _looks(color: Array, metallic: Array, roughness: Array) -> SurfaceLooks:
    """Surfaces without images. color: (L, 4)."""
    count = len(color)
    return SurfaceLooks(
        color=np.ascontiguousarray(color[:, :3].T, np.float32),
        metallic=metallic.astype(np.float32),
        roughness=roughness.astype(np.float32),
        alpha=np.clip(color[:, 3], 0.0, 1.0).astype(np.float32),
        image=np.full(count, -1, np.int64),
        uses_attribute=np.zeros(count, bool),
    )


def _background(shading, scene, area) -> Background:
    """The background of a viewport."""
    if shading.type == "SOLID" and shading.background_type != "THEME":
        linear = shading.background_color
        if shading.background_type == "WORLD":
            linear = scene.world.color if scene.world else (0.0, 0.0, 0.0)
        return Background(tuple(Color(linear).from_scene_linear_to_srgb()))
    gradients = bpy.context.preferences.themes[0].view_3d.space.gradients
    return Background(
        tuple(gradients.high_gradient), tuple(gradients.gradient), gradients.background_type, area
    )


def _cavity(shading) -> Cavity:
    """The factors of cavity. Those of World cavity serve as well: ridges and valleys are the screen's."""
    if shading.cavity_type == "WORLD":
        return Cavity(shading.cavity_ridge_factor, shading.cavity_valley_factor)
    return Cavity(shading.curvature_ridge_factor, shading.curvature_valley_factor)


def _overlays(numbers: Numbers, overlay, view_layer, background: Background) -> Overlays:
    """The outlines and warnings that a viewport shows."""
    theme = bpy.context.preferences.themes[0].view_3d
    if overlay is None or not overlay.show_overlays:
        return Overlays()
    return Overlays(
        states=_states(numbers, view_layer) if overlay.show_outline_selected else None,
        selected=tuple(shown_as_overlay(theme.object_selected)),
        active=tuple(shown_as_overlay(theme.object_active)),
        fold=tuple(shown_as_overlay(line_colors(background.color)["FOLD"])),
    )


def _states(numbers: Numbers, view_layer) -> IndexArray | None:
    """The states of the table's objects, None if none is selected. Blender outlines none in Edit Mode."""
    chosen = {obj.session_uid: SELECTED for obj in view_layer.objects.selected if obj.mode == "OBJECT"}
    active = view_layer.objects.active
    if active is not None and active.session_uid in chosen:
        chosen[active.session_uid] = ACTIVE
    if not chosen:
        return None
    uids = np.array(sorted(chosen))
    state_of = np.array([chosen[uid] for uid in uids.tolist()])
    place = np.minimum(np.searchsorted(uids, numbers.owners), len(uids) - 1)
    return np.where(uids[place] == numbers.owners, state_of[place], 0)


def _axes(camera) -> Array:
    """A camera's right, up and backward in world space, unit columns (3, 3)."""
    axes = np.array(camera.matrix_world, np.float64)[:3, :3]
    length = np.linalg.norm(axes, axis=0)
    return axes / np.where(length > 0.0, length, 1.0)
