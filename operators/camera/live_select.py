# SPDX-License-Identifier: GPL-3.0-or-later
"""Select by a click in Live View: the keymap items before Blender's own Select, and their operator.

Blender selects on a press or on a click, by keymap and tool. Each item here stands in the same keymap as
one of Blender's and acts on the events that Blender's would act on.
"""

import bpy
from bpy.props import StringProperty

from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.live.seen_object import place_at, seen_object, shown_camera
from ..common.target import selected_objects
from ..common.tool import select_only

SELECT = "view3d.select"
# The keymaps in which Blender's configurations have Select for Object Mode.
KEYMAPS = ("3D View", "3D View Tool: Tweak", "3D View Tool: Tweak (fallback)")
BUTTONS, VALUES = ("LEFTMOUSE", "RIGHTMOUSE"), ("PRESS", "CLICK")
MODIFIERS = ("shift", "ctrl", "alt", "oskey")
# Options of Select with another meaning than the object under the mouse.
OTHER_MEANINGS = ("center", "enumerate", "object")


def blenders_item(context, name: str, event):
    """Blender's own item of a keymap that would select by this event, or None."""
    keymap = context.window_manager.keyconfigs.user.keymaps.get(name)
    for item in keymap.keymap_items if keymap is not None else ():
        if item.idname != SELECT or not item.active:
            continue
        if (item.type, item.value, item.key_modifier) != (event.type, event.value, "NONE"):
            continue
        if item.any or all(getattr(item, key) in (-1, getattr(event, key)) for key in MODIFIERS):
            return None if any(getattr(item.properties, key) for key in OTHER_MEANINGS) else item
    return None


def selection(view_layer) -> tuple:
    """The selected objects and the active one, to compare."""
    active = view_layer.objects.active
    return {obj.as_pointer() for obj in view_layer.objects if obj.select_get()}, active


def select(context, found, options) -> None:
    """Select an object, or nothing, as Blender's Select does with these options."""
    objects = context.view_layer.objects
    if found is None:
        if options.deselect_all and not (options.toggle or options.extend or options.deselect):
            for obj in selected_objects(context):
                obj.select_set(False)
    elif options.deselect or (options.toggle and found.select_get() and found == objects.active):
        found.select_set(False)
    elif options.toggle or options.extend:
        found.select_set(True)
        objects.active = found
    elif not (options.select_passthrough and found.select_get()):
        select_only(context, found)
    else:
        objects.active = found


class SCFPF_OT_live_select(bpy.types.Operator):
    """Select the object that Live View shows under the mouse"""

    bl_idname = "scfpf.live_select"
    bl_label = "Select in Live View"
    bl_options = {"UNDO"}

    keymap: StringProperty(
        name="Keymap",
        description="Name of the keymap whose own Select this one stands for",
        default=KEYMAPS[0],
        options={"HIDDEN", "SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return context.mode == "OBJECT" and shown_camera(context) is not None

    def invoke(self, context, event):
        item = blenders_item(context, self.keymap, event)
        place = None if item is None else place_at(context, event)
        if place is None:
            return {"PASS_THROUGH"}
        try:
            found = seen_object(context, place)
        except USER_ERRORS:
            return {"PASS_THROUGH"}  # Live View shows no image of such a volume.
        if found is None and place.camera.scfpf.edit_volume:
            return {"PASS_THROUGH"}  # Control surfaces can be clicked.
        before = selection(context.view_layer)
        select(context, found, item.properties)
        self._is_changed = selection(context.view_layer) != before
        if event.value == "CLICK":
            return {"FINISHED"} if self._is_changed else {"CANCELLED"}
        # Both at once end the press here, and yet let Blender recognise a drag, which a tool may wait for.
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL", "PASS_THROUGH"}

    def modal(self, _context, event):
        if event.value not in {"CLICK_DRAG", "PRESS", "RELEASE"}:
            return {"PASS_THROUGH"}
        # Finished, the release does not become a click, and the undo step precedes that of a drag.
        return {"FINISHED" if self._is_changed else "CANCELLED", "PASS_THROUGH"}


def register():
    bpy.utils.register_class(SCFPF_OT_live_select)
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is None:  # in the background there are no keys
        return
    for name in KEYMAPS:
        items = configuration.keymaps.new(name=name, space_type="VIEW_3D", region_type="WINDOW").keymap_items
        for button in BUTTONS:
            for value in VALUES:
                item = items.new(SCFPF_OT_live_select.bl_idname, button, value, any=True, head=True)
                item.properties.keymap = name


def unregister():
    configuration = bpy.context.window_manager.keyconfigs.addon
    for name in KEYMAPS if configuration is not None else ():
        keymap = configuration.keymaps.get(name)
        for item in list(keymap.keymap_items) if keymap is not None else ():
            if item.idname == SCFPF_OT_live_select.bl_idname:
                keymap.keymap_items.remove(item)
    bpy.utils.unregister_class(SCFPF_OT_live_select)
