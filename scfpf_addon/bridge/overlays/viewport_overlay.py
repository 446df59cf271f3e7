# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewing volumes of flexible cameras, drawn in the 3D viewport.

The lines come from ``projection.diagrams.diagram``. They are cached as GPU batches, which change only with
the volume, not with the view.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import bpy
import gpu
from gpu_extras.batch import batch_for_shader
from mathutils import Color, Matrix

from ...projection.diagrams.diagram import DiagramOptions, diagram, even_iso, volume_signature
from ...projection.diagrams.line_colors import line_colors
from ...projection.diagrams.projector_lines import projector_point
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ..blender.draw_handler import DrawHandler
from ..camera.live_camera import chosen_camera
from ..camera.read_projection import read_projection
from ..render.image_size import image_aspect
from ..sync.camera_sync import concerned

SHADER = "POLYLINE_UNIFORM_COLOR"
# Multiples of the line thickness that the preferences suggest for the screen.
LINE_WIDTHS = {
    "ISO": 1.0,
    "SURFACE": 1.0,
    "PROJECTOR": 1.5,
    "FOLD": 2.0,
    "FOLDED": 1.0,
    "FAR": 2.5,
    "SAFE": 1.5,
    "FRAME": 2.5,
    "U": 2.0,
    "V": 2.0,
    "PICK": 3.0,
}
POINT_SHADER = "POINT_UNIFORM_COLOR"
# Pixels across the dot where the picked projector meets the scene.
DOT_SIZE = 10.0
# The default background of draw_volume: the 3D viewport of Blender's dark theme.
DARK_BACKGROUND = (0.24, 0.24, 0.24)
# Lines move towards the viewer by the width of so many pixels at their distance, so that they cover faces and
# wires in the same place, also slanted ones.
NEARER = 2.0
# They also move by this share of the depth buffer's range: a dozen of its steps and of float32's roundings,
# which exceed pixels far away if clipping starts near.
NEARER_DEPTH = 1e-6
# ``VolumeDrawing.edits`` of a drawing whose volume must be read again.
STALE = -1


@dataclass
class VolumeDrawing:
    """The cached drawing of one camera's volume.

    edits: ``Drawings.edits`` when the volume was read. settings: safe areas and wired surfaces. signature:
    None while the volume cannot be read. dot: of the picked position.
    """

    edits: int
    aspect: float
    settings: tuple[tuple, tuple]
    signature: bytes | None = None
    batches: dict[str, gpu.types.GPUBatch] = field(default_factory=dict)
    dot: gpu.types.GPUBatch | None = None

    def update(self, projection: Projection, options: DiagramOptions, pick_t: float) -> None:
        """Make the batches if the volume or the options have changed. pick_t: of the dot, -1 for none."""
        signature = volume_signature(projection, options, pick_t)
        if signature == self.signature:
            return
        shader = gpu.shader.from_builtin(SHADER)
        self.batches = {
            role: batch_for_shader(shader, "LINES", {"pos": segments.reshape(-1, 3)})
            for role, segments in diagram(projection, options).items()
            if len(segments)
        }
        self.dot = None
        if options.pick is not None and pick_t >= 0.0:
            point = projector_point(projection, *options.pick, pick_t)
            shader = gpu.shader.from_builtin(POINT_SHADER)
            if len(point):
                self.dot = batch_for_shader(shader, "POINTS", {"pos": point})
        self.signature = signature

    def clear(self) -> None:
        """Draw nothing, while the volume cannot be read."""
        self.signature, self.batches, self.dot = None, {}, None


class Drawings:
    """The drawings of all flexible cameras, by scene, view layer and camera.

    Holds names, session ids, numbers and GPU batches, no Blender data. _lists: how often the lists of drawn
    cameras may have changed.
    """

    def __init__(self):
        self.edits = 0
        self._lists = 0
        self._cameras: dict[tuple[int, str], tuple[int, set[int]]] = {}
        self._drawings: dict[tuple[int, str, int], VolumeDrawing] = {}

    def __len__(self):
        return len(self._drawings)

    def mark_edited(self, cameras: set[int] | None = None):
        """Let the volumes of some cameras, session ids, or of all be read again before they are drawn."""
        if cameras is None:
            self.edits += 1
        for key, drawing in self._drawings.items() if cameras else ():
            if key[2] in cameras:
                drawing.edits = STALE
        self._lists += cameras is None or bool(cameras)

    def clear(self):
        """Forget everything, for another file."""
        self.mark_edited()
        self._cameras.clear()
        self._drawings.clear()

    def cameras(self, scene, view_layer) -> list:
        """The objects of a view layer that are flexible cameras with their drawing switched on."""
        key = (scene.session_uid, view_layer.name)
        lists, known = self._cameras.get(key, (-1, set()))
        # One pass over all objects is much faster than a search for each camera by its name.
        if lists == self._lists:
            return [o for o in view_layer.objects if o.session_uid in known] if known else []
        found = [o for o in view_layer.objects if _is_drawn(o)]
        known = {o.session_uid for o in found}
        self._cameras[key] = (self._lists, known)
        for old in [k for k in self._drawings if k[:2] == key and k[2] not in known]:
            del self._drawings[old]
        return found

    def drawing(self, camera, depsgraph, aspect: float) -> VolumeDrawing:
        """The present drawing of a camera's volume; empty while the volume cannot be read."""
        key = (depsgraph.scene.original.session_uid, depsgraph.view_layer.name, camera.session_uid)
        # Handlers get no notice of changes of these.
        shown = safe_areas(camera.data, depsgraph.scene), wired_surfaces(camera)
        drawing = self._drawings.setdefault(key, VolumeDrawing(STALE, aspect, shown))
        if (drawing.edits, drawing.aspect, drawing.settings) == (self.edits, aspect, shown):
            return drawing
        drawing.edits, drawing.aspect, drawing.settings = self.edits, aspect, shown
        options, pick_t = diagram_options(camera.evaluated_get(depsgraph).scfpf)
        options = replace(options, safe_areas=shown[0], without=shown[1])
        try:
            drawing.update(read_projection(camera, depsgraph, aspect), options, pick_t)
        except UserError:
            # The panel and the render report the reason.
            drawing.clear()
        return drawing


def diagram_options(settings) -> tuple[DiagramOptions, float]:
    """The options of a camera's drawing, and the t of the dot on the picked projector, -1 for none."""
    count = settings.projector_count
    options = DiagramOptions(
        count,
        count,
        iso=(settings.iso_t,) if settings.iso_surfaces == 1 else even_iso(settings.iso_surfaces),
        folds=settings.show_folds,
        pick=tuple(settings.pick) if settings.show_pick else None,
    )
    return options, settings.pick_t if settings.show_pick else -1.0


def safe_areas(lens, scene) -> tuple[tuple[float, float], ...]:
    """The margins of the safe areas that a camera shows, without those of margin 0, which are the frame."""
    margins = scene.safe_areas
    shown = []
    if lens.show_safe_areas:
        shown += [margins.title, margins.action]
        if lens.show_safe_center:
            shown += [margins.title_center, margins.action_center]
    return tuple(tuple(margin) for margin in shown if any(margin))


def wired_surfaces(camera) -> tuple[int, ...]:
    """The numbers of the surfaces whose wires Blender draws in the Edit Volume mode, to be clicked on.

    A second grid would cover these wires and the colour of selected ones.
    """
    settings = camera.scfpf
    if not settings.edit_volume:
        return ()
    return tuple(
        number
        for number, slot in enumerate(settings.surfaces)
        if slot.object is not None
        and (slot.object.select_get() or slot.object.display_type == "WIRE")
        and slot.object.display_type != "BOUNDS"
        and slot.object.visible_get()
    )


def _is_drawn(candidate) -> bool:
    return candidate.type == "CAMERA" and candidate.scfpf.enabled and candidate.scfpf.show_projectors


drawings = Drawings()


def draw_volume(
    camera,
    depsgraph,
    aspect: float,
    width_scale: float = 1.0,
    background: tuple[float, float, float] = DARK_BACKGROUND,
) -> None:
    """Draw the volume of one camera into the active framebuffer, with the matrices that are set.

    depsgraph: evaluated. aspect: width / height of the image. width_scale: factor of the line widths, which
    are in pixels. background: the display colour behind the lines, which determines theirs. The depth buffer
    hides lines except in the Edit Volume mode, in which Blender also draws the surfaces' wires in front.
    Draws nothing while the volume cannot be read.
    """
    drawing = drawings.drawing(camera, depsgraph, aspect)
    if not drawing.batches:
        return
    colors = line_colors(background)
    shader = gpu.shader.from_builtin(SHADER)
    depth_test = "NONE" if camera.scfpf.edit_volume else "LESS_EQUAL"
    gpu.state.depth_mask_set(False)
    gpu.state.blend_set("ALPHA")
    shader.bind()
    size = gpu.state.viewport_get()[2:]
    shader.uniform_float("viewportSize", size)
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        projection = gpu.matrix.get_projection_matrix()
        gpu.matrix.load_matrix(_nearer(projection, size[1]) @ gpu.matrix.get_model_view_matrix())
        projection[2] -= 2 * NEARER_DEPTH * projection[3]
        gpu.matrix.load_projection_matrix(projection)
        gpu.state.depth_test_set(depth_test)
        for role, batch in drawing.batches.items():
            shader.uniform_float("lineWidth", LINE_WIDTHS[role] * width_scale)
            shader.uniform_float("color", colors[role])
            batch.draw(shader)
        if drawing.dot is not None:
            gpu.state.point_size_set(DOT_SIZE * width_scale)
            shader = gpu.shader.from_builtin(POINT_SHADER)
            shader.bind()
            shader.uniform_float("color", colors["PICK"])
            drawing.dot.draw(shader)
    gpu.state.blend_set("NONE")
    gpu.state.depth_mask_set(True)
    gpu.state.depth_test_set("NONE")


def viewport_background(scene, space, theme) -> tuple[float, float, float]:
    """The display colour behind the lines of a 3D viewport: the shading's own, else the theme's."""
    shading = space.shading
    if shading.type in {"SOLID", "WIREFRAME"} and shading.background_type != "THEME":
        world = scene.world
        if shading.background_type == "WORLD" and world is None:
            return (0.0, 0.0, 0.0)
        linear = world.color if shading.background_type == "WORLD" else shading.background_color
        return tuple(Color(linear).from_scene_linear_to_srgb())
    return tuple(theme.view_3d.space.gradients.high_gradient)


def _nearer(projection, height: int) -> Matrix:
    """A matrix in view space that moves points towards the viewer and not on the screen.

    projection: (4, 4), of the view. height: of the viewport, pixels.
    """
    # At unit distance in a perspective view, anywhere in an orthographic one.
    width = NEARER * 2 / (projection[1][1] * height)
    if projection[3][3] == 0.0:
        return Matrix.Diagonal((1 - width, 1 - width, 1 - width, 1.0))
    return Matrix.Translation((0.0, 0.0, width))


def visible_cameras(scene, view_layer, space, looking_through: bool) -> list:
    """The flexible cameras whose volumes a 3D viewport shows: those that it shows as objects.

    They are not shown if overlays or extras are off, if they are hidden or outside of a local view.
    looking_through: the viewport looks through its camera, whose volume is then not shown, as its frame.
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
    if chosen_camera(context) is not None:
        return  # They would hide what the camera shows.
    looking_through = context.region_data.view_perspective == "CAMERA"
    cameras = visible_cameras(scene, view_layer, context.space_data, looking_through)
    if not cameras:
        return
    try:
        aspect = image_aspect(scene)
    except UserError:
        # The image is too large, which renders report; its aspect is unknown.
        return
    depsgraph = context.evaluated_depsgraph_get()
    background = viewport_background(scene, context.space_data, context.preferences.themes[0])
    for camera in cameras:
        draw_volume(camera, depsgraph, aspect, context.preferences.system.pixel_size, background)


def scene_updated(_scene, depsgraph) -> None:
    """Note the cameras whose lines an evaluation may have changed."""
    # An unlinked surface counts as deleted.
    if depsgraph.id_type_updated("COLLECTION"):
        drawings.mark_edited()
    else:
        drawings.mark_edited(concerned(depsgraph))


def file_changed() -> None:
    """Note that any camera's lines may have changed."""
    drawings.mark_edited()


def file_loaded() -> None:
    """Forget the lines of the file before."""
    drawings.clear()


_draw_handler = DrawHandler(bpy.types.SpaceView3D, draw_viewport, "POST_VIEW")


def register():
    _draw_handler.register()


def unregister():
    _draw_handler.unregister()
    drawings.clear()
