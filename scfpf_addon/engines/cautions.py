# SPDX-License-Identifier: GPL-3.0-or-later
"""Cautions about pictures joined from ordinary renders: what they lack or show in another way."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from ..bridge.blender import versions
from ..bridge.blender.shader_nodes import output_shaders
from ..bridge.scene.read_visibility import rendered_objects
from ..cycles.rig_data import CYCLES
from ..projection.user_error import Message
from ..shading.settings.stylised_settings import Stylised

# Switched off in the renders.
LEFT_OUT = "Left out of pictures that are joined: {0}"
LEFT_OUT_SETTINGS = {
    "use_motion_blur": "motion blur",
    "use_freestyle": "Freestyle",
    "use_border": "the border, the whole picture is rendered",
    "use_multiview": "stereoscopy, this is one view",
}
# Without faces, which the caster would meet, and without depth.
AS_IT_COMES = "Shown only where an ordinary render has it in front of faces, not along projectors: {0}"
SMOKE = "smoke"
# Those that have a depth, but in image layers are shown as they come.
FACELESS = {"GREASEPENCIL": "Grease Pencil", "CURVES": "hair", "POINTCLOUD": "points"}
# Colours of several things in one pixel.
SOFT = "Soft and clear parts have what is behind them in an ordinary render: {0}"
# Found by each render in its own picture.
BY_SCREEN = "Seen by each ordinary render in its own picture only, it may change where they meet: {0}"
# Drawn Style has colours of its own between lines.
OTHER_FILL = (
    "Drawn Style's fill is left out: lines, hatching and paper are drawn over the renders. Choose the fill "
    "Rendered, or render with Flexible Projection"
)


def fill_cautions(style: Stylised | None) -> list[Message]:
    """What joined pictures do not show of Drawn Style."""
    return [Message(OTHER_FILL)] if style is not None and style.fill != "RENDERED" else []


def left_out(scene) -> list[str]:
    """The settings of a scene that its joined pictures do not follow."""
    render = scene.render
    found = [text for name, text in LEFT_OUT_SETTINGS.items() if getattr(render, name)]
    if render.use_compositing and versions.present_compositor_tree(scene) is not None:
        found.append("the compositor, with its glare or bloom")
    editor = scene.sequence_editor
    if render.use_sequencer and editor is not None and len(versions.strips(editor)):
        found.append("the sequencer")
    return found


def cautions(
    scene, settings_left_out: list[str], has_lens: bool, members: Mapping[int, int] | None = None
) -> list[Message]:
    """What a scene's joined picture does not show as the scene says.

    settings_left_out: what ``left_out`` has found in the artist's scene. has_lens: whether depth of field is
    on. members: the numbers of image layers by session id of objects; None without any.
    """
    missing = [*settings_left_out, *(["depth of field"] if has_lens else [])]
    if members and scene.render.engine not in {versions.EEVEE, CYCLES}:
        missing.append("shadows and reflections between layers")
    by_screen = [*_by_screen(scene)]
    shown = [obj for obj in rendered_objects(scene.view_layers[0]) if not obj.hide_render]
    faceless = {SMOKE} if _has_smoke(scene, shown) else set()
    soft: set[str] = set()
    for obj in shown:
        is_in_layer = bool(members and members.get(obj.session_uid))
        (faceless if is_in_layer else soft).update(_faceless(obj))
    found = []
    if missing:
        found.append(Message(LEFT_OUT, ", ".join(missing)))
    if faceless:
        found.append(Message(AS_IT_COMES, ", ".join(sorted(faceless))))
    if FACELESS["GREASEPENCIL"] in soft:
        found.append(Message(SOFT, FACELESS["GREASEPENCIL"]))
    if by_screen:
        found.append(Message(BY_SCREEN, ", ".join(by_screen)))
    return found


def _has_smoke(scene, shown: Iterable) -> bool:
    """Return whether a scene's world, or one of the objects that it shows, is smoke or mist."""
    world = scene.world
    if world is not None and versions.uses_nodes(world) and any(output_shaders(world.node_tree, "Volume")):
        return True
    return any(
        obj.type == "VOLUME" or any(_has_volume(slot.material) for slot in obj.material_slots)
        for obj in shown
    )


def _faceless(obj) -> Iterator[str]:
    """What an object shows that has no faces."""
    if obj.type in FACELESS:
        yield FACELESS[obj.type]
    for system in obj.particle_systems:
        if system.settings.render_type == "PATH":
            yield FACELESS["CURVES"]


def _has_volume(material) -> bool:
    """Return whether a material, or None, has a volume."""
    if material is None or not versions.uses_nodes(material):
        return False
    return any(output_shaders(material.node_tree, "Volume"))


def _by_screen(scene) -> Iterator[str]:
    """The effects of an engine that depend on what its own picture shows."""
    if scene.render.engine == versions.EEVEE and scene.eevee.use_raytracing:
        yield "reflections and light by Raytracing"
    if scene.render.engine == "BLENDER_WORKBENCH" and scene.display.shading.show_cavity:
        yield "Cavity"
    if scene.render.engine == "BLENDER_WORKBENCH" and scene.display.shading.show_object_outline:
        yield "Outline"
