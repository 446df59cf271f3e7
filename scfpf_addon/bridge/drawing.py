# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewing volumes of flexible cameras, drawn in the 3D viewport.

The lines come from ``projection.diagram``. They are kept as GPU batches and made
anew only when an edit has changed the volume, never because the view turns.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import gpu
from bpy.app.handlers import persistent
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ..projection.diagram import COLORS, diagram, volume_signature
from .read_projection import ProjectionError, read_projection
from .render_job import RenderError, picture_aspect

SHADER = "POLYLINE_UNIFORM_COLOR"
# Multiples of the line thickness that the preferences suggest for the screen.
LINE_WIDTHS = {"SURFACE": 1.0, "PROJECTOR": 1.5, "FRAME": 2.5}
# Lines come nearer to the viewer by as much as this many pixels are wide at their distance, so that
# they win against faces and wires in the same place, slanted ones too.
NEARER = 2.0


@dataclass
class Drawing:
    """What is kept of one camera's volume. signature: None while the volume cannot be read."""

    edits: int
    aspect: float
    signature: bytes | None = None
    batches: dict[str, gpu.types.GPUBatch] = field(default_factory=dict)


class Drawings:
    """The drawings of all flexible cameras, by scene, view layer and camera.

    Holds names, session ids, numbers and GPU batches, no Blender data.
    """

    def __init__(self):
        self.edits = 0
        self._cameras: dict[tuple[int, str], tuple[int, list[tuple[str, int]]]] = {}
        self._drawings: dict[tuple[int, str, int], Drawing] = {}

    def __len__(self):
        return len(self._drawings)

    def mark_edited(self):
        """Something in the file may have changed: read the volumes again when they are drawn next."""
        self.edits += 1

    def clear(self):
        """Forget everything, for another file."""
        self.mark_edited()
        self._cameras.clear()
        self._drawings.clear()

    def cameras(self, scene, view_layer) -> list:
        """The objects of a view layer that are flexible cameras with their drawing switched on."""
        key = (scene.session_uid, view_layer.name)
        edits, known = self._cameras.get(key, (-1, []))
        if edits != self.edits:
            known = [(o.name, o.session_uid) for o in view_layer.objects if _is_drawn(o)]
            self._cameras[key] = (self.edits, known)
            kept = {uid for _, uid in known}
            for old in [k for k in self._drawings if k[:2] == key and k[2] not in kept]:
                del self._drawings[old]
        found = [view_layer.objects.get(name) for name, _ in known]
        return [o for o, (_, uid) in zip(found, known, strict=True) if o is not None and o.session_uid == uid]

    def batches(self, camera, depsgraph, aspect: float) -> dict[str, gpu.types.GPUBatch]:
        """The lines of a camera's volume by role; none while the volume cannot be read."""
        key = (depsgraph.scene.original.session_uid, depsgraph.view_layer.name, camera.session_uid)
        drawing = self._drawings.get(key)
        if drawing is not None and (drawing.edits, drawing.aspect) == (self.edits, aspect):
            return drawing.batches
        if drawing is None:
            drawing = self._drawings[key] = Drawing(self.edits, aspect)
        drawing.edits, drawing.aspect = self.edits, aspect
        count = camera.scfpf.projector_count
        try:
            projection = read_projection(camera, depsgraph, aspect)
        except ProjectionError:
            # The panel and the render say what is wrong with the volume.
            drawing.signature, drawing.batches = None, {}
            return drawing.batches
        signature = volume_signature(projection, count)
        if signature != drawing.signature:
            shader = gpu.shader.from_builtin(SHADER)
            drawing.batches = {
                role: batch_for_shader(shader, "LINES", {"pos": segments.reshape(-1, 3)})
                for role, segments in diagram(projection, count, count).items()
                if len(segments)
            }
            drawing.signature = signature
        return drawing.batches


def _is_drawn(candidate) -> bool:
    return candidate.type == "CAMERA" and candidate.scfpf.enabled and candidate.scfpf.show_projectors


drawings = Drawings()


def draw_volume(camera, depsgraph, aspect: float, width_scale: float = 1.0) -> None:
    """Draw the volume of one camera into the active framebuffer, with the matrices that are set.

    depsgraph: evaluated. aspect: width / height of the picture. width_scale:
    multiplies the line widths, in pixels. Hides behind what the depth buffer holds; draws
    nothing while the volume cannot be read.
    """
    batches = drawings.batches(camera, depsgraph, aspect)
    if not batches:
        return
    shader = gpu.shader.from_builtin(SHADER)
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    gpu.state.blend_set("ALPHA")
    shader.bind()
    size = gpu.state.viewport_get()[2:]
    shader.uniform_float("viewportSize", size)
    with gpu.matrix.push_pop():
        nearer = _nearer(gpu.matrix.get_projection_matrix(), size[1])
        gpu.matrix.load_matrix(nearer @ gpu.matrix.get_model_view_matrix())
        for role, batch in batches.items():
            shader.uniform_float("lineWidth", LINE_WIDTHS[role] * width_scale)
            shader.uniform_float("color", COLORS[role])
            batch.draw(shader)
    gpu.state.blend_set("NONE")
    gpu.state.depth_mask_set(True)
    gpu.state.depth_test_set("NONE")


def _nearer(projection, height: int) -> Matrix:
    """A matrix in view space that brings points nearer and leaves them where they are seen.

    projection: the view's, (4, 4). height: of the viewport, pixels.
    """
    # At unit distance in a perspective view, anywhere in an orthographic one.
    width = NEARER * 2 / (projection[1][1] * height)
    if projection[3][3] == 0.0:
        return Matrix.Diagonal((1 - width, 1 - width, 1 - width, 1.0))
    return Matrix.Translation((0.0, 0.0, width))


def visible_cameras(scene, view_layer, space, looking_through: bool) -> list:
    """The flexible cameras whose volume a 3D viewport shows.

    Those that it shows as objects too: not with overlays or extras off, not hidden,
    not outside its local view. looking_through: the viewport looks through its
    camera, whose own volume is then left out, as Blender does with a camera's lines.
    """
    overlay = space.overlay
    if not (overlay.show_overlays and overlay.show_extras and space.show_object_viewport_camera):
        return []
    own = space.camera if looking_through else None
    return [
        camera
        for camera in drawings.cameras(scene, view_layer)
        if camera != own and camera.visible_get(view_layer=view_layer, viewport=space)
    ]


def draw_viewport() -> None:
    """The draw handler: the volumes that the viewport being drawn shows."""
    context = bpy.context
    scene, view_layer = context.scene, context.view_layer
    looking_through = context.region_data.view_perspective == "CAMERA"
    cameras = visible_cameras(scene, view_layer, context.space_data, looking_through)
    if not cameras:
        return
    try:
        aspect = picture_aspect(scene)
    except RenderError:
        # Rendering says that the picture is too large; its shape is not known here.
        return
    depsgraph = context.evaluated_depsgraph_get()
    for camera in cameras:
        draw_volume(camera, depsgraph, aspect, context.preferences.system.pixel_size)


@persistent
def _file_edited(*_):
    drawings.mark_edited()


@persistent
def _file_loaded(*_):
    drawings.clear()


HANDLERS = {
    "depsgraph_update_post": _file_edited,
    "frame_change_post": _file_edited,
    "undo_post": _file_edited,
    "redo_post": _file_edited,
    "load_post": _file_loaded,
}
_viewport_handlers = []


def register():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)
    _viewport_handlers.append(
        bpy.types.SpaceView3D.draw_handler_add(draw_viewport, (), "WINDOW", "POST_VIEW")
    )


def unregister():
    while _viewport_handlers:
        bpy.types.SpaceView3D.draw_handler_remove(_viewport_handlers.pop(), "WINDOW")
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(function)
    drawings.clear()
