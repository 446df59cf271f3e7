# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3D viewport that shows a nodes preview: split off the artist's own, or in a window of its own.

Its local collections show what the view layer hides; its local view shows nothing else.
"""

from __future__ import annotations

import bpy

from ...projection.user_error import UserError
from .preview_data import pictures_of

# A viewport narrower than twice this, in pixels at interface scale 1, is not split.
NARROWEST = 250
# Above a half: the new viewport is then the right one.
SPLIT_FACTOR = 0.501
# Shadings of the preview: in EEVEE and Cycles, lights would stand in warped space.
SHADINGS = {"SOLID", "MATERIAL"}
# Colours of Solid shading: those by object would show one object only.
COLORS = {"MATERIAL", "SINGLE", "TEXTURE", "VERTEX"}

# Addresses of the areas that showed a preview: nothing else tells them once its camera is gone.
_shown_in: set[int] = set()


def _viewports():
    """(window, area) of every 3D viewport in every window."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                yield window, area


def _shows_one_of(area, cameras: set) -> bool:
    """Return whether a viewport has a local camera that is one of some."""
    space = area.spaces.active
    return space.use_local_camera and space.camera in cameras


def preview_cameras() -> set:
    """The cameras that viewports of previews look through."""
    return {c.scfpf_preview.view_camera for c in bpy.data.collections} - {None}


def viewports_of(source) -> list:
    """(window, area) of every 3D viewport in a window that shows a preview."""
    cameras = {source.scfpf_preview.view_camera} - {None}
    return [(window, area) for window, area in _viewports() if _shows_one_of(area, cameras)]


def note_viewports() -> None:
    """Remember the viewports that show previews, after a file was loaded."""
    cameras = preview_cameras()
    _shown_in.clear()
    _shown_in.update(area.as_pointer() for _, area in _viewports() if _shows_one_of(area, cameras))


def close_orphans() -> None:
    """Close the viewports whose preview is gone: they look through another camera, or none."""
    cameras = preview_cameras()
    orphans = [
        (window, area)
        for window, area in _viewports()
        if area.as_pointer() in _shown_in and area.spaces.active.camera not in cameras
    ]
    for window, area in orphans:
        space = area.spaces.active
        if space.use_local_camera and space.use_local_collections:
            close_viewport(window, area)


def open_viewport(context, source) -> None:
    """Show a preview beside the present viewport if there is room, else in a window of its own.

    Raises UserError; nothing is left open then.
    """
    if bpy.app.background:
        raise UserError("Blender runs in the background: there is no window to show the preview in")
    window, beside = _roomiest(context, source.scfpf_preview.scene)
    area = None
    try:
        if beside is not None and beside.width >= 2 * NARROWEST * context.preferences.system.ui_scale:
            area = _split(window, beside)
        if area is None:
            window, area = _open_window(window, beside)
        show_preview(window, area, source)
    except Exception as error:  # The artist's screen becomes as it was after any error.
        if area is not None:
            close_viewport(window, area)
        if isinstance(error, RuntimeError):
            raise UserError("No viewport can show the preview: {0}", error) from error
        raise


def _roomiest(context, scene) -> tuple:
    """The viewport to split: the present one, else the widest; (window, None) without a viewport."""
    taken = preview_cameras()
    free = [
        (window, area)
        for window, area in _viewports()
        if window.scene == scene and not _shows_one_of(area, taken)
    ]
    if (context.window, context.area) in free:
        return context.window, context.area
    here = [(window, area) for window, area in free if window == context.window] or free
    return max(here, key=lambda pair: pair[1].width, default=(context.window, None))


def _region(area):
    return next(region for region in area.regions if region.type == "WINDOW")


def _split(window, area):
    """The right half of an area as one of its own; None if Blender does not split it."""
    before = {other.as_pointer() for other in window.screen.areas}
    with bpy.context.temp_override(window=window, area=area, region=_region(area)):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=SPLIT_FACTOR)
    return next((other for other in window.screen.areas if other.as_pointer() not in before), None)


def _open_window(window, area) -> tuple:
    override = {"window": window} if area is None else {"window": window, "area": area}
    with bpy.context.temp_override(**override):
        bpy.ops.wm.window_new()
    window = bpy.context.window_manager.windows[-1]
    area = window.screen.areas[0]
    area.type = "VIEW_3D"
    return window, area


def show_preview(window, area, source) -> None:
    """Turn a 3D viewport into one that shows a preview and nothing else."""
    _shown_in.add(area.as_pointer())
    settings = source.scfpf_preview
    space = area.spaces.active
    _set_look(space)
    with bpy.context.temp_override(window=window, area=area, region=_region(area)):
        if space.region_quadviews:
            bpy.ops.screen.region_quadview()
        space.use_local_camera = True
        space.camera = settings.view_camera
        space.use_local_collections = False
        space.use_local_collections = True
        _show_shelf(window, space, source)
        if space.local_view is None:
            _enter_local_view(window.view_layer, source)
        show_alone(window.view_layer, space, pictures_of(source))
        space.region_3d.view_perspective = "CAMERA"
        bpy.ops.view3d.view_center_camera()


def _set_look(space) -> None:
    space.overlay.show_overlays = False
    space.show_gizmo = False
    bars = ("show_region_ui", "show_region_toolbar", "show_region_tool_header", "show_region_asset_shelf")
    for name in bars:
        # Hiding a hidden bar again would animate it, and might leave it open. A bar that the mode does not
        # have is read-only: the asset shelf after Sculpt Mode.
        if getattr(space, name) and not space.is_property_readonly(name):
            setattr(space, name, False)
    space.show_object_viewport_mesh = True
    space.use_render_border = False
    space.region_3d.use_clip_planes = False
    if space.shading.type not in SHADINGS:
        space.shading.type = "SOLID"
    if space.shading.color_type not in COLORS:
        space.shading.color_type = "MATERIAL"
    space.shading.show_xray = False


def _show_shelf(window, space, source) -> None:
    """Switch a preview's shelf on in a viewport's local collections."""
    if not _sees_shelf(window.view_layer, space, source.scfpf_preview.parts[0].picture):
        _toggle_shelf(window, source)


def _toggle_shelf(window, source) -> None:
    number = _layer_index(window.view_layer, source.scfpf_preview.shelf)
    bpy.ops.object.hide_collection(collection_index=number, toggle=True)


def _sees_shelf(view_layer, space, picture) -> bool:
    """Return whether a viewport's local collections show an object, regardless of its local view."""
    view_layer.update()
    evaluated = picture.evaluated_get(view_layer.depsgraph)
    if space.local_view is None:
        return evaluated.visible_in_viewport_get(space)
    was_shown = picture.local_view_get(space)
    picture.local_view_set(space, True)
    view_layer.update()
    shown = picture.evaluated_get(view_layer.depsgraph).visible_in_viewport_get(space)
    picture.local_view_set(space, was_shown)
    return shown


def _layer_index(view_layer, collection) -> int:
    """The index of a view layer's collection, as operators take it."""
    order = []

    def walk(layer):
        order.append(layer.collection)
        for child in layer.children:
            walk(child)

    walk(view_layer.layer_collection)
    return order.index(collection)


def _enter_local_view(view_layer, source) -> None:
    """Enter the local view, for which Blender needs a selection."""
    picture, shelf = source.scfpf_preview.parts[0].picture, source.scfpf_preview.shelf
    shelf.hide_select = False
    view_layer.update()
    try:
        picture.select_set(True, view_layer=view_layer)
        bpy.ops.view3d.localview(frame_selected=False)
    finally:
        picture.select_set(False, view_layer=view_layer)
        shelf.hide_select = True


def show_alone(view_layer, space, pictures) -> None:
    """Make a viewport's local view show some objects and nothing else."""
    for other in view_layer.objects:
        if other not in pictures and other.local_view_get(space):
            other.local_view_set(space, False)
    for picture in pictures:
        picture.local_view_set(space, True)


def show_more(pictures, source) -> None:
    """Let the viewports of a preview show its new picture objects too."""
    for _window, area in viewports_of(source):
        for picture in pictures:
            picture.local_view_set(area.spaces.active, True)


def keep_out(members, source) -> None:
    """Take new objects out of the local view of a preview's viewports: its pictures show them."""
    for _window, area in viewports_of(source):
        space = area.spaces.active
        if space.local_view is not None:
            for member in members:
                if member.local_view_get(space):
                    member.local_view_set(space, False)


def hide_from_others(source) -> None:
    """Switch a new preview off in other viewports with local collections, which show new collections."""
    picture = source.scfpf_preview.parts[0].picture
    for window, area in _viewports():
        space = area.spaces.active
        if window.scene != source.scfpf_preview.scene or not space.use_local_collections:
            continue
        if space.camera != source.scfpf_preview.view_camera and _sees_shelf(
            window.view_layer, space, picture
        ):
            with bpy.context.temp_override(window=window, area=area, region=_region(area)):
                _toggle_shelf(window, source)


def close_viewport(window, area) -> None:
    """Close a preview's viewport: its window, or its area, which the viewport beside it takes."""
    _shown_in.discard(area.as_pointer())
    windows = bpy.context.window_manager.windows
    if len(window.screen.areas) == 1 and len(windows) > 1:
        with bpy.context.temp_override(window=window):
            bpy.ops.wm.window_close()
        return
    # In the background the positions of areas do not agree: joining two may never end (5.2).
    stays = bpy.app.background or len(window.screen.areas) == 1
    sibling = None if stays else _sibling(window, area)
    with bpy.context.temp_override(window=window, area=area, region=_region(area)):
        if sibling is not None:
            bpy.ops.screen.area_join(source_xy=_centre(sibling), target_xy=_centre(area))
        elif stays or bpy.ops.screen.area_close() != {"FINISHED"}:
            _restore(area.spaces.active)


def _centre(area) -> tuple[int, int]:
    return area.x + area.width // 2, area.y + area.height // 2


def _sibling(window, area):
    """The 3D viewport left of a preview's and of the same height, so that the two can be joined; or None."""
    taken = preview_cameras()
    for other in window.screen.areas:
        if other.type != "VIEW_3D" or other == area or _shows_one_of(other, taken):
            continue
        gap = area.x - (other.x + other.width)
        if (other.y, other.height) == (area.y, area.height) and 0 <= gap < NARROWEST // 10:
            return other
    return None


def _restore(space) -> None:
    """Make a preview's viewport an ordinary one, if it cannot be closed."""
    if space.local_view is not None:
        bpy.ops.view3d.localview(frame_selected=False)
    space.use_local_collections = False
    space.use_local_camera = False
    space.region_3d.view_perspective = "PERSP"
    space.overlay.show_overlays = True
    space.show_gizmo = True
    space.show_region_toolbar = True
    space.show_region_tool_header = True
