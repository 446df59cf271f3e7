# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways to see a flexible camera's picture in viewports, and to render it with F12."""

import bpy

from ...scfpf_addon.bridge.blender import versions
from ...scfpf_addon.bridge.blender.draw_handler import DrawHandler
from ...scfpf_addon.bridge.blender.rig_mark import camera_behind
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.camera.live_camera import SHADINGS
from ...scfpf_addon.bridge.render.render_engine import ENGINE
from ...scfpf_addon.cycles.engine_choice import renders_by_cycles
from ...scfpf_addon.cycles.prices import compute
from ...scfpf_addon.cycles.rig_data import CYCLES, rig_of
from ...scfpf_addon.scanline.preview.preview_viewports import preview_cameras
from ..common.target import (
    camera_of,
    flexible_camera_of,
    poll_flexible,
    poll_flexible_camera,
    poll_flexible_camera_in_any_mode,
)
from ..common.tool import plain
from ..common.words import report_text
from ..image.preparation import redraw_interface

NO_VIEWPORT = "This window has no 3D viewport to show the picture in: open one"
OTHER_ENGINE = (
    "Rendered shading uses the scene's render engine, which ignores the volume: press Flexible "
    "Projection below With F12 first"
)


def joined_engine(scene) -> str:
    """The engine whose renders the panel offers to join: EEVEE, or another one that the scene has."""
    engine: str = scene.render.engine
    return versions.EEVEE if engine in {ENGINE, CYCLES} else engine


def viewport_for(context, camera):
    """The 3D viewport's area that a button of this context acts on, or None.

    The present one, else of this window one that looks through the camera, else the largest.
    """
    taken, window = preview_cameras(), context.window
    found = [
        area
        for area in (window.screen.areas if window is not None else ())
        if area.type == "VIEW_3D" and area.spaces.active.camera not in taken
    ]
    if context.area in found:
        return context.area
    return max(found, key=lambda area: (looks_through(area, context.scene, camera), area.width), default=None)


def looks_through(area, scene, camera) -> bool:
    """Return whether a 3D viewport looks through a camera."""
    space = area.spaces.active
    seen = space.camera if space.use_local_camera else scene.camera
    return seen == camera and space.region_3d.view_perspective == "CAMERA"


def look_through(area, scene, camera) -> None:
    """Let a 3D viewport look through a camera, its own one if the scene has another."""
    space = area.spaces.active
    if (space.camera if space.use_local_camera else scene.camera) != camera:
        space.use_local_camera = True
        space.camera = camera
    space.region_3d.view_perspective = "CAMERA"


def is_live(area, scene, camera) -> bool:
    """Return whether a 3D viewport shows a camera live."""
    shown = camera.scfpf.show_live and area.spaces.active.shading.type in SHADINGS
    return shown and looks_through(area, scene, camera)


def is_rendered(area, scene, camera) -> bool:
    """Return whether a 3D viewport shows a camera's picture in Rendered shading."""
    shown = scene.render.engine == ENGINE and area.spaces.active.shading.type == "RENDERED"
    return shown and looks_through(area, scene, camera)


def is_any(context, camera, shows) -> bool:
    """Return whether ``shows(area, scene, camera)`` is true of a 3D viewport in the present window."""
    areas = context.window.screen.areas if context.window is not None else ()
    return any(area.type == "VIEW_3D" and shows(area, context.scene, camera) for area in areas)


def rendered_camera(scene) -> str:
    """The name of the camera that F12 shows, "" without one."""
    camera = camera_behind(scene.camera)
    return camera.name if camera is not None else ""


def _toggle_rendered(context, area) -> None:
    """Switch Rendered shading on, or back to the shading before it."""
    region = next(region for region in area.regions if region.type == "WINDOW")
    with context.temp_override(area=area, region=region):
        bpy.ops.view3d.toggle_shading(type="RENDERED")


def _poll_viewport(cls, context) -> bool:
    if viewport_for(context, camera_of(context)) is None:
        cls.poll_message_set(NO_VIEWPORT)
        return False
    return True


class SCFPF_OT_view_live(bpy.types.Operator):
    """Look through the flexible camera, in Solid or Material Preview shading: the viewport shows what its
    projectors see while you drag, until you press again"""

    bl_idname = "scfpf.view_live"
    bl_label = "Live View"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        return poll_flexible_camera_in_any_mode(cls, context) and _poll_viewport(cls, context)

    def execute(self, context):
        note_edit()
        camera = camera_of(context)
        area = viewport_for(context, camera)
        camera.scfpf.show_live = not is_live(area, context.scene, camera)
        if camera.scfpf.show_live:
            look_through(area, context.scene, camera)
            shading = area.spaces.active.shading
            if shading.type == "RENDERED":
                _toggle_rendered(context, area)
            if shading.type not in SHADINGS:
                shading.type = "SOLID"
        return {"FINISHED"}


class SCFPF_OT_view_rendered(bpy.types.Operator):
    """Look through the flexible camera in Rendered shading, with the light and the materials of F12, until
    you press again"""

    bl_idname = "scfpf.view_rendered"
    bl_label = "Rendered View"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        if not poll_flexible(cls, context) or not _poll_viewport(cls, context):
            return False
        if context.scene.render.engine != ENGINE:
            cls.poll_message_set(OTHER_ENGINE)
            return False
        return True

    def execute(self, context):
        camera = camera_of(context)
        area = viewport_for(context, camera)
        was_rendered = is_rendered(area, context.scene, camera)
        look_through(area, context.scene, camera)
        if was_rendered or area.spaces.active.shading.type != "RENDERED":
            _toggle_rendered(context, area)
        return {"FINISHED"}


class SCFPF_OT_cycles_use(bpy.types.Operator):
    """Let Cycles render the flexible camera's picture with F12, with all light and materials that it has
    (the camera's own motion is not blurred; instead of Depth and Mist use the passes of t and depth)"""

    bl_idname = "scfpf.cycles_use"
    bl_label = "Use Cycles for F12"
    bl_options = {"REGISTER", "UNDO"}

    poll = classmethod(poll_flexible_camera)

    @classmethod
    def description(cls, context, _properties):
        camera = flexible_camera_of(context)
        text = plain(cls.__doc__)
        return f"{text}.\n\n{price_text(context, camera)}" if camera is not None else text

    def invoke(self, context, _event):
        return self._use(context, "INVOKE_DEFAULT")

    def execute(self, context):
        note_edit()
        return self._use(context, "EXEC_DEFAULT")

    def _use(self, context, how: str):
        scene, rig = context.scene, rig_of(context.scene)
        if rig is not None and rig.scfpf_rig.camera == camera_of(context):
            scene.render.engine, scene.camera = CYCLES, rig.scfpf_rig.view_camera
            return {"FINISHED"}
        try:
            done = bpy.ops.scfpf.cycles_rig(how)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        # While it plans, Set Up Cycles has a step of undo of its own.
        return {"CANCELLED"} if "RUNNING_MODAL" in done else done


def price_text(context, camera) -> str:
    """The price of Cycles for a camera in a sentence, or why it can have none; quick if it is known."""
    if renders_by_cycles(context.scene, camera):
        return "It is switched on"
    try:
        found = compute(camera, context.scene, context.evaluated_depsgraph_get())
    except USER_ERRORS as error:
        return str(error)
    if isinstance(found, str):
        return found
    # Before the rig is made nobody knows how many portals its rays skip.
    bound = "about" if found.passed else "up to"
    memory = report_text("{0:,.0f} MB", found.memory / 1e6)
    return report_text(
        "Price: {0} {1:.1f} times the time of an ordinary camera, and {2}", bound, found.cost, memory
    )


# How each 3D viewport was drawn last, by the address of its region.
_views: dict[int, tuple[str, str]] = {}


def _viewport_drawn() -> None:
    """Have the panels drawn again if a viewport looks through another thing: Blender does not."""
    context = bpy.context
    region = context.region.as_pointer()
    now = context.region_data.view_perspective, context.space_data.shading.type
    if _views.get(region) != now:
        _views[region] = now
        if not bpy.app.timers.is_registered(_redraw):
            bpy.app.timers.register(_redraw, first_interval=0.0)


def _redraw() -> None:
    redraw_interface(bpy.context.window_manager)


_watch = DrawHandler(bpy.types.SpaceView3D, _viewport_drawn, "POST_PIXEL")
_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SCFPF_OT_view_live, SCFPF_OT_view_rendered, SCFPF_OT_cycles_use)
)


def register():
    _register_classes()
    _watch.register()


def unregister():
    _watch.unregister()
    _views.clear()
    if bpy.app.timers.is_registered(_redraw):
        bpy.app.timers.unregister(_redraw)
    _unregister_classes()
