# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of targets: add views, pins, straight lines and regions that stay; remove, order and turn them."""

from __future__ import annotations

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatVectorProperty

from ...scfpf_addon.bridge.aim import new_targets
from ...scfpf_addon.bridge.blender.scene_objects import link_beside, object_by_uid
from ...scfpf_addon.bridge.blender.slot_animation import AIM_TARGETS, move_slot
from ...scfpf_addon.bridge.camera.flexible_camera import control_objects
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.projection.volume.inverse import find_in_image
from ...scfpf_addon.shading.picking.pick import pick
from ..camera.camera_placement import camera_like_view
from ..common.target import active_object, selected_objects
from ..common.tool import STEPS
from ..common.words import report_text
from ..image.preparation import prepared_inputs
from .aim_camera import AimAction, camera_name, chosen, own_projection, target_at, target_index, thing_name


def _position():
    return FloatVectorProperty(
        name="Position",
        description="Place in the picture, as shares of its width and height from its lower left",
        size=2,
        default=(0.5, 0.5),
        options={"SKIP_SAVE"},
    )


def selected_things(context) -> list:
    """The selected objects that a view or a layer can show."""
    own = control_objects()
    return [
        o for o in selected_objects(context) if o.type not in {"CAMERA", "LIGHT"} and o.name_full not in own
    ]


def _thing(context):
    """The collection and the object, one of them None, that the selection is. Raises UserError."""
    objects = selected_things(context)
    if not objects:
        raise UserError("Select the objects that the view is to show")
    if len(objects) == 1:
        return None, objects[0]
    return collection_of(context, objects), None


def collection_of(context, objects: list):
    """The collection of exactly these objects, a new one if there is none."""
    wanted = set(objects)
    for collection in objects[0].users_collection:
        if set(collection.all_objects) == wanted:
            return collection
    first = active_object(context) if active_object(context) in wanted else objects[0]
    name = first.name if len(objects) == 1 else report_text("{0} and {1} More", first.name, len(objects) - 1)
    made = bpy.data.collections.new(name)
    context.scene.collection.children.link(made)
    for obj in objects:
        made.objects.link(obj)
    return made


class SCFPF_OT_aim_view_add(AimAction, bpy.types.Operator):
    """Add a view: the picture shows the selected objects as a camera of their own sees them, in a frame
    that starts where they are"""

    bl_idname = "scfpf.aim_view_add"
    bl_label = "Add View"
    makes_flexible = True

    camera: camera_name()
    collection: thing_name("Collection", "Name of the collection to show; empty for the selection")
    object: thing_name("Object", "Name of the object to show; empty for the selection")
    eye: thing_name(
        "Seen From", "Name of the camera or empty that the view is seen from; empty for a new camera"
    )
    from_viewport: BoolProperty(
        name="From Viewport",
        description="See the view as the 3D viewport does at present, instead of as the picture does",
        options={"SKIP_SAVE"},
    )
    position: _position()

    def edit(self, context, camera):
        collection = chosen(bpy.data.collections, self.collection, "collection")
        obj = chosen(bpy.data.objects, self.object, "object")
        eye = chosen(bpy.data.objects, self.eye, "object")
        if eye is not None and (eye.type not in {"CAMERA", "EMPTY"} or eye == camera):
            raise UserError("'{0}' cannot be looked from: choose another camera or an empty", eye.name)
        projection = own_projection(context, camera)
        if collection is None and obj is None:
            collection, obj = _thing(context)
        if eye is None and self.from_viewport:
            eye = _viewport_eye(context, camera)
        depsgraph = context.evaluated_depsgraph_get()
        target = new_targets.add_view(camera, depsgraph, projection, collection, obj, eye)
        if self.properties.is_property_set("position"):
            target.position = self.position
        return report_text("Turn '{0}' or move the view's frame, then press Solve", target.eye.name)


def _viewport_eye(context, camera):
    """A new camera with the viewport's view. Raises UserError."""
    found = camera_like_view(context, image_aspect(context.scene))
    if found is None:
        raise UserError("There is no 3D viewport to look from: run this in one, or choose a camera")
    eye = bpy.data.objects.new("View", found[0])
    eye.matrix_world = found[1]
    link_beside(eye, camera)
    return eye


class SCFPF_OT_aim_pin_add(AimAction, bpy.types.Operator):
    """Add a pin: a point of the scene, by default that at the 3D cursor, that the picture shows at one
    place"""

    bl_idname = "scfpf.aim_pin_add"
    bl_label = "Add Pin"
    makes_flexible = True

    camera: camera_name()
    point: FloatVectorProperty(
        name="Point",
        description="The point in world space; by default what the picture shows at Position",
        size=3,
        subtype="TRANSLATION",
        options={"SKIP_SAVE"},
    )
    position: _position()
    direction: FloatVectorProperty(
        name="Direction",
        description="The direction in which the point is seen, in world space; 0 for any",
        size=3,
        default=(0.0, 0.0, 0.0),
        options={"SKIP_SAVE"},
    )

    def edit(self, context, camera):
        has_point, has_place = (self.properties.is_property_set(name) for name in ("point", "position"))
        uid, position = camera.session_uid, tuple(self.position)
        name = "Pin"
        if has_place and not has_point:
            point, name = _seen_point(context, camera, position)
        else:
            point = np.array(self.point if has_point else context.scene.cursor.location, np.float64)
        if not has_place:
            position = _place_of(own_projection(context, camera), point)
        direction = np.array(self.direction, np.float64)
        length = float(np.linalg.norm(direction))
        new_targets.add_pin(
            object_by_uid(uid), point, position, direction / length if length > 0.0 else None, f"{name} Pin"
        )


def _seen_point(context, camera, position):
    """The point that the image shows at a position, and its object's name. Raises USER_ERRORS."""
    inputs = prepared_inputs(context, camera)
    size = 1 / inputs.settings.width, 1 / inputs.settings.height
    found = pick(inputs.projection, inputs.scene, *position, size)
    if found is None or found.t is None:
        raise UserError("The picture shows nothing at that place: choose a point on an object")
    return found.position, found.object_name


def _place_of(projection, point):
    """The position at which the image shows a point. Raises UserError."""
    place = find_in_image(projection, point[:, None])
    if not place.found[0]:
        raise UserError("The picture does not show that point: give its position in the picture too")
    return float(place.x[0]), float(place.y[0])


class SCFPF_OT_aim_line_add(AimAction, bpy.types.Operator):
    """Keep the line between two pins, by default the selected handles, straight in the picture"""

    bl_idname = "scfpf.aim_line_add"
    bl_label = "Add Straight Line"

    camera: camera_name()
    first: thing_name("First Pin", "Name of the handle where the line begins; empty for the selection")
    second: thing_name("Second Pin", "Name of the handle where the line ends; empty for the selection")

    def edit(self, context, camera):
        ends = [chosen(bpy.data.objects, name, "object") for name in (self.first, self.second)]
        if None in ends:
            handles = [target.handle for target in camera.scfpf.aim_targets]
            ends = [obj for obj in selected_objects(context) if obj in handles]
        if len(ends) != 2:
            raise UserError("Select the handles of two pins")
        new_targets.add_line(camera, *ends)


class SCFPF_OT_aim_stay_add(AimAction, bpy.types.Operator):
    """Hold the selected objects, or a painted region, where the picture shows them"""

    bl_idname = "scfpf.aim_stay_add"
    bl_label = "Add Stay"
    makes_flexible = True

    camera: camera_name()
    collection: thing_name("Collection", "Name of the collection that stays; empty for the selection")
    object: thing_name("Object", "Name of the object that stays; empty for the selection")
    mask: thing_name("Mask", "Name of an image over the whole picture: what is white stays")

    def edit(self, context, camera):
        collection = chosen(bpy.data.collections, self.collection, "collection")
        obj = chosen(bpy.data.objects, self.object, "object")
        mask = chosen(bpy.data.images, self.mask, "image")
        if collection is None and obj is None and mask is None:
            collection, obj = _thing(context)
        new_targets.add_stay(camera, collection, obj, mask)


class SCFPF_OT_aim_remove(AimAction, bpy.types.Operator):
    """Remove the target, and leave the volume as it is until Solve is pressed"""

    bl_idname = "scfpf.aim_remove"
    bl_label = "Remove Target"

    camera: camera_name()
    index: target_index()

    def edit(self, context, camera):
        new_targets.remove_target(camera, target_at(camera, self.index)[1])


class SCFPF_OT_aim_move(AimAction, bpy.types.Operator):
    """Move the target in the list"""

    bl_idname = "scfpf.aim_move"
    bl_label = "Move Target"

    camera: camera_name()
    direction: EnumProperty(
        name="Direction",
        description="Direction in the list",
        items=(("UP", "Up", "Towards the top"), ("DOWN", "Down", "Towards the bottom")),
        default="UP",
    )

    def edit(self, context, camera):
        index = target_at(camera, -1)[1]
        move_slot(camera.scfpf, index, index + STEPS[self.direction], AIM_TARGETS)


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_OT_aim_view_add,
        SCFPF_OT_aim_pin_add,
        SCFPF_OT_aim_line_add,
        SCFPF_OT_aim_stay_add,
        SCFPF_OT_aim_remove,
        SCFPF_OT_aim_move,
    )
)
