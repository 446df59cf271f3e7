# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera that an operator of Aim works on, made flexible if it is not, and things chosen by name."""

from __future__ import annotations

import bpy
from bpy.props import IntProperty, StringProperty

from ...scfpf_addon.bridge.blender.all_or_nothing import Kept, all_or_nothing
from ...scfpf_addon.bridge.camera.flexible_camera import make_flexible, volume_from_camera
from ...scfpf_addon.bridge.camera.read_projection import read_projection
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.user_error import UserError
from ..common.target import active_object, camera_of, poll_object_mode, take_up_edits
from ..common.tool import Action


def camera_name():
    """The property by which operators of Aim take a camera."""
    return StringProperty(
        name="Camera",
        description="Name of the camera to aim; empty for the active one, or else the scene's",
        options={"SKIP_SAVE"},
    )


def thing_name(name: str, description: str):
    """A property that takes a collection or an object by its name."""
    return StringProperty(name=name, description=description, options={"SKIP_SAVE"})


def target_index():
    """The property by which operators take a target."""
    return IntProperty(
        name="Index",
        description="Place in the list of targets; -1 is the active one",
        default=-1,
        min=-1,
        options={"SKIP_SAVE"},
    )


def aimed_camera(context):
    """The camera to aim, or None: the active object may be the eye or the handle of one of its targets."""
    active = active_object(context)
    if active is not None and active.type in {"CAMERA", "EMPTY"} and not active.scfpf.enabled:
        for camera in context.scene.objects:
            if camera.type == "CAMERA" and any(
                active in (target.eye, target.handle) for target in camera.scfpf.aim_targets
            ):
                return camera
    return camera_of(context)


def chosen(collection, name: str, what: str):
    """The member of ``bpy.data``'s collection with a name, None for an empty name. Raises UserError."""
    if not name:
        return None
    found = collection.get(name)
    if found is None:
        raise UserError("There is no {0} '{1}': choose another one", what, name)
    return found


def target_at(camera, index: int):
    """A camera's target and its place. index: -1 for the active one. Raises UserError."""
    targets = camera.scfpf.aim_targets
    index = camera.scfpf.active_aim if index < 0 else index
    if index >= len(targets):
        raise UserError(
            "'{0}' has no target at place {1}: add one with Add View or Add Pin", camera.name, index + 1
        )
    return targets[index], index


def own_projection(context, camera):
    """The projection of a camera in world space, as the scene's image has it. Raises USER_ERRORS."""
    return read_projection(camera, context.evaluated_depsgraph_get(), image_aspect(context.scene))


class AimAction(Action):
    """An operator that does ``edit(context, camera)`` on an editable camera, which becomes flexible first."""

    makes_flexible = False
    poll = classmethod(poll_object_mode)

    def act(self, context):
        with all_or_nothing() as kept:
            return self.edit(context, self.prepared(context, kept))

    def prepared(self, context, kept: Kept | None = None):
        """The camera to work on, flexible if that is needed. Raises USER_ERRORS.

        kept: takes the settings of the camera before anything is changed.
        """
        named = chosen(bpy.data.objects, self.camera, "object")
        camera = named or aimed_camera(context)
        if camera is None or camera.type != "CAMERA":
            raise UserError("There is no camera to aim: select one")
        if not camera.is_editable:
            raise UserError(
                "'{0}' is linked from another file: make a library override of it first", camera.name
            )
        take_up_edits(context)
        if kept is not None:
            kept.keep(camera.scfpf)
            for scene in camera.users_scene:
                # The first flexible camera of a scene sets it.
                kept.keep(scene.scfpf_sampling, "world_shadows")
        if self.makes_flexible and not camera.scfpf.enabled:
            if len(camera.scfpf.surfaces):
                make_flexible(camera, again=True)
            else:
                volume_from_camera(camera, context.scene)
            context.view_layer.update()
        return camera

    def edit(self, context, camera) -> str | None:
        raise NotImplementedError
