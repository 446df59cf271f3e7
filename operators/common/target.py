# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera and the slot that an operator or a panel works on, and the polls that require them."""

import bpy

from ...scfpf_addon.bridge.blender.rig_mark import camera_behind
from ...scfpf_addon.bridge.blender.scene_objects import is_being_edited, missing_text
from ...scfpf_addon.bridge.camera.read_projection import is_lattice_volume
from ...scfpf_addon.bridge.sync.camera_sync import camera_objects
from ...scfpf_addon.bridge.volume.camera_members import grids_of, surfaces_of
from ...scfpf_addon.projection.user_error import UserError

NO_CAMERA = (
    "There is no flexible camera to render: add one with Add > Camera > Flexible Camera, or select one"
)


def active_object(context):
    """The active object, or None. Blender's own context has none without a window, as in a timer."""
    if hasattr(context, "object"):
        return context.object
    return context.view_layer.objects.active


def selected_objects(context) -> list:
    """The selected objects, also in a context without a window."""
    if hasattr(context, "selected_objects"):
        return list(context.selected_objects or ())
    return list(context.view_layer.objects.selected)


def camera_with_surface(scene, surface):
    """The camera of ``scene`` that lists ``surface``, or None."""
    parent = surface.parent
    candidates = [parent] if parent is not None and parent.type == "CAMERA" else []
    for camera in candidates + [obj for obj in scene.objects if obj.type == "CAMERA"]:
        if any(slot.object == surface for slot in camera.scfpf.surfaces):
            return camera
    return None


def camera_aimed_with(scene, obj):
    """The camera of a scene with a layer or a target of Aim that an object sees or holds, or None."""
    for camera in camera_objects():
        is_used = any(obj in (target.eye, target.handle) for target in camera.scfpf.aim_targets)
        is_used = is_used or any(obj == layer.camera for layer in camera.scfpf.layers)
        if is_used and scene.objects.get(camera.name) == camera:
            return camera
    return None


def camera_of(context):
    """The camera object to work on, flexible or not, or None.

    The active object if it is a camera, else the camera that the active object is a control surface of, else
    the scene's camera. An object that a target of Aim is seen from or held by stands for the aimed
    camera, and the ordinary camera of a layer for the one with the layer.
    """
    active = active_object(context)
    if active is not None:
        if active.type in {"CAMERA", "EMPTY"} and not active.scfpf.enabled:
            aimed = camera_aimed_with(context.scene, active)
            if aimed is not None:
                return aimed
        if active.type == "CAMERA":
            return camera_behind(active)
        # Panels call this at every redraw: only control surfaces are searched for.
        owner = camera_with_surface(context.scene, active) if active.scfpf_surface.kind != "NONE" else None
        if owner is not None:
            return owner
    return camera_behind(context.scene.camera)


def flexible_camera_of(context):
    """``camera_of`` if it is a flexible camera, else None."""
    camera = camera_of(context)
    return camera if camera is not None and camera.scfpf.enabled else None


def poll_scene(cls, context) -> bool:
    """Poll for operators that change the scene's own settings."""
    if not context.scene.is_editable:
        cls.poll_message_set("The scene is linked from another file: make it local first")
        return False
    return True


def poll_object_mode(cls, context) -> bool:
    """Poll for operators that add or remove objects, which needs Object Mode everywhere in Blender."""
    if context.mode != "OBJECT":
        cls.poll_message_set("Go to Object Mode first")
        return False
    return True


def poll_camera(cls, context) -> bool:
    """Poll for operators on an editable camera in Object Mode, in whatever scene its surfaces are edited."""
    if not (poll_camera_in_any_mode(cls, context) and poll_object_mode(cls, context)):
        return False
    camera = camera_of(context)
    if any(is_being_edited(member) for member in (*surfaces_of(camera), *grids_of(camera))):
        cls.poll_message_set(
            "A control surface or grid is being edited in another scene: go to Object Mode there"
        )
        return False
    return True


def poll_camera_in_any_mode(cls, context) -> bool:
    """``poll_camera`` for operators that add and remove no objects."""
    if not _has_camera(cls, context):
        return False
    if not camera_of(context).is_editable:
        cls.poll_message_set("The camera is linked from another file: make a library override of it first")
        return False
    return True


def _has_camera(cls, context) -> bool:
    if camera_of(context) is None:
        cls.poll_message_set("Select a camera, or add one with Add > Camera > Flexible Camera")
        return False
    return True


def poll_flexible_camera(cls, context) -> bool:
    """``poll_camera`` for operators that need the camera to be flexible."""
    return _is_not_ordinary(cls, context) and poll_camera(cls, context)


def poll_flexible_camera_in_any_mode(cls, context) -> bool:
    """``poll_flexible_camera`` for operators that work in every mode."""
    return _is_not_ordinary(cls, context) and poll_camera_in_any_mode(cls, context)


def poll_flexible(cls, context) -> bool:
    """``poll_flexible_camera_in_any_mode`` for operators that leave the camera as it is, linked or not."""
    return _is_not_ordinary(cls, context) and _has_camera(cls, context)


def _is_not_ordinary(cls, context) -> bool:
    camera = camera_of(context)
    if camera is not None and not camera.scfpf.enabled:
        cls.poll_message_set("Switch on Flexible Projection for this camera first")
        return False
    return True


def active_slot(camera):
    """The active entry of a camera's list of control surfaces, or None."""
    settings = camera.scfpf
    chosen = settings.active_surface
    return settings.surfaces[chosen] if chosen < len(settings.surfaces) else None


def poll_slot(cls, context) -> bool:
    """Poll for operators on the active control surface."""
    if not poll_flexible_camera(cls, context):
        return False
    if active_slot(flexible_camera_of(context)) is None:
        cls.poll_message_set("Choose a control surface in the camera's list first")
        return False
    return True


def poll_volume(cls, context) -> bool:
    """Poll for operators on a whole volume: at least two surfaces, or a lattice."""
    if not poll_flexible_camera(cls, context):
        return False
    slots = flexible_camera_of(context).scfpf.surfaces
    if len(slots) < 2 and not is_lattice_volume(slots):
        cls.poll_message_set("The volume needs at least two control surfaces: add one with +")
        return False
    return True


def render_camera(context):
    """The scene's camera if it is flexible, else ``flexible_camera_of``: the camera of Render by default."""
    camera = camera_behind(context.scene.camera)
    if camera is not None and camera.scfpf.enabled:
        return camera
    return flexible_camera_of(context)


def chosen_camera(context, name: str):
    """The flexible camera called ``name``, or ``render_camera`` if the name is empty. Raises UserError."""
    camera = bpy.data.objects.get(name) if name else render_camera(context)
    if camera is None:
        if name:
            raise UserError('There is no object "{0}" to look through: choose a flexible camera', name)
        raise UserError(missing_text(context.scene.camera) or NO_CAMERA)
    if camera.type != "CAMERA" or not camera.scfpf.enabled:
        raise UserError("{0} is not a flexible camera: switch on Flexible Projection for it", camera.name)
    return camera


def editable_camera(context, name: str):
    """``chosen_camera`` if it is editable, so that results can be stored on it. Raises UserError."""
    camera = chosen_camera(context, name)
    if not camera.is_editable:
        raise UserError("{0} is linked from another file: make a library override of it", camera.name)
    return camera


def take_up_edits(context) -> None:
    """Write the edits of objects in Edit Mode or another mode to their data."""
    edited_objects = getattr(context, "objects_in_mode", ()) if context.mode != "OBJECT" else ()
    for edited in edited_objects:
        edited.update_from_editmode()
