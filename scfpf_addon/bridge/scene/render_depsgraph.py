# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as evaluated for F12, at any time and without rendering.

A viewport's depsgraph lacks objects that are hidden in the viewport, and has the viewport's modifiers and
subdivision levels. Blender makes a render depsgraph for its own renders and bakes only. A bake leaves the
user's last render, its slots and the render handlers alone. So this module lets Blender bake a triangle with
an engine whose ``bake`` receives the depsgraph and reads from it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import bpy

from ...projection.user_error import UserError

ENGINE = "SCFPF_READER"

_Result = TypeVar("_Result")


def with_render_depsgraph(
    scene, view_layer, read: Callable[..., _Result], with_time: bool = False
) -> _Result:
    """Return ``read(depsgraph)`` with the scene evaluated for a render of the view layer.

    with_time: call ``read(depsgraph, set_frame)`` instead, where set_frame(frame, subframe=…) evaluates
    another time; the last one must be the scene's own. The depsgraph ends with the call: ``read`` must return
    arrays and numbers only. The scene is left as it was. Raises the errors of ``read``, and
    UserError if Blender refuses (another bake is running, or the scene is linked).
    """
    outcome: list[tuple[_Result | None, BaseException | None]] = []

    class SceneReader(bpy.types.RenderEngine):
        bl_idname = ENGINE
        bl_label = "SCFPF Scene Reader"

        def bake(self, depsgraph, object, pass_type, pass_filter, width, height):
            try:
                outcome.append((read(depsgraph, self.frame_set) if with_time else read(depsgraph), None))
            except BaseException as error:  # Blender would only print it: the caller raises it.
                outcome.append((None, error))

    if scene.library:
        raise UserError("The scene '{0}' is linked from another file: render it there", scene.name)
    engine = scene.render.engine
    target = _bake_target()
    bpy.utils.register_class(SceneReader)
    try:
        scene.collection.objects.link(target)
        scene.render.engine = ENGINE
        _bake(scene, view_layer, target)
    except RuntimeError as error:
        raise UserError("Blender cannot evaluate the scene: {0}", error) from error
    finally:
        scene.render.engine = engine
        bpy.utils.unregister_class(SceneReader)
        bpy.data.meshes.remove(target.data)
    if not outcome:
        raise UserError("Blender cannot evaluate the scene: wait for the bake or the render that is running")
    result, error = outcome[0]
    if error is not None:
        raise error
    return result


def _bake_target():
    """A triangle that no image shows, with the attribute for a bake to vertex colours."""
    mesh = bpy.data.meshes.new(ENGINE)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    mesh.color_attributes.new("Color", "FLOAT_COLOR", "CORNER")
    target = bpy.data.objects.new(ENGINE, mesh)
    for ray in ("camera", "shadow", "glossy", "transmission"):
        setattr(target, f"visible_{ray}", False)
    return target


def _bake(scene, view_layer, target) -> None:
    """Bake ``target`` alone; every option is given, or the scene's own bake settings would count."""
    with bpy.context.temp_override(
        scene=scene, view_layer=view_layer, active_object=target, object=target, selected_objects=[target]
    ):
        bpy.ops.object.bake(
            type="EMIT",
            target="VERTEX_COLORS",
            save_mode="INTERNAL",
            use_clear=False,
            use_selected_to_active=False,
            use_cage=False,
            use_split_materials=False,
            use_automatic_name=False,
        )
