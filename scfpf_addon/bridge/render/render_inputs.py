# SPDX-License-Identifier: GPL-3.0-or-later
"""The inputs of a render, all read from Blender at once: then a thread sees arrays only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from ...projection.user_error import Message, UserError
from ...projection.volume.viewing_volume import Projection
from ...shading.passes.cryptomatte import identifiers
from ...shading.passes.data_passes import DataPasses
from ...shading.scene.motion import Moment
from ...shading.scene.shading_scene import Scene
from ...shading.settings.frame_settings import Border, FrameSettings
from ..blender.scene_objects import absent_text
from ..blends.camera_blend import unbaked
from ..camera.ordinary_camera import frustum_projection
from ..camera.read_depth_of_field import read_lens
from ..camera.read_projection import read_projection
from ..camera.stereo_views import Eye, eye_projection, own_depth_plane, unseen_settings
from ..layers.read_image_layers import ReadLayers, read_image_layers
from ..scene.read_images import with_images
from ..scene.read_motion import MotionReader, read_moments, read_neighbours
from ..scene.read_scene import FACELESS, never, read_scene
from ..scene.read_world import missing_light_warnings
from ..scene.render_depsgraph import with_render_depsgraph
from ..settings.sampling import sampling_of
from ..settings.stylised_properties import stylised_of
from ..volume.volume_object import sync_volume_object
from .image_size import image_size, shown_aspect
from .render_passes import crypto_names, transparency_warning


@dataclass(frozen=True)
class RenderInputs:
    """The inputs of a render: arrays and numbers only, because Blender may change or free its data meanwhile.

    moments: what the samples see while the shutter is open, () without motion blur. image_layers: those
    of the projection, and which objects they show. is_ordinary: whether the image is what the camera sees
    as an ordinary one.
    """

    projection: Projection
    scene: Scene
    settings: FrameSettings
    moments: tuple[Moment, ...] = ()
    image_layers: ReadLayers = field(default_factory=ReadLayers)
    is_ordinary: bool = False


def synced_image_size(scene, camera) -> tuple[int, int]:
    """The size of a scene's image, after the volume objects of a camera and its layers are restored.

    They keep hidden surfaces evaluated, and may have been deleted. Raises UserError.
    """
    size = image_size(scene)
    if lost := absent_text(camera, scene, Message("choose another camera")):
        raise UserError(lost)
    for each in (camera, *(layer.camera for layer in camera.scfpf.layers)):
        if each is not None and each.scfpf.enabled and each.is_editable:
            sync_volume_object(each)
    return size


def with_light_warnings(inputs: RenderInputs, depsgraph) -> RenderInputs:
    """Add warnings about light that the image lacks; drawn pictures have their own light."""
    if inputs.settings.stylised:
        return inputs
    scene = inputs.scene
    found = missing_light_warnings(scene, inputs.projection, depsgraph.scene_eval)
    return replace(inputs, scene=replace(scene, warnings=(*scene.warnings, *found)))


def prepare(scene, view_layer, camera, pixel_error: float | None = None) -> RenderInputs:
    """Read the inputs of an image of ``view_layer`` through ``camera``, as evaluated for a render.

    pixel_error: overrides the camera's own. Of a scene with several views it is the camera's own view,
    between the eyes. Raises USER_ERRORS.
    """
    size = synced_image_size(scene, camera)

    def read(depsgraph, set_frame) -> RenderInputs:
        inputs = read_inputs(depsgraph, camera, size, pixel_error=pixel_error)
        inputs = with_light_warnings(inputs, depsgraph)
        return with_motion(inputs, depsgraph, camera, set_frame)

    inputs = with_render_depsgraph(scene, view_layer, read, with_time=True)
    if not scene.render.use_multiview:
        return inputs
    warning = Message(
        "This is one view, that of '{0}': press F12 with Flexible Projection for all views of the scene",
        camera.name,
    )
    return replace(inputs, scene=replace(inputs.scene, warnings=(*inputs.scene.warnings, warning)))


def read_inputs(
    depsgraph,
    camera,
    size: tuple[int, int],
    *,
    pixel_error: float | None = None,
    border: Border | None = None,
    passes: tuple[str, ...] = (),
    may_be_empty: bool = False,
    scene: Scene | None = None,
    aspect: float | None = None,
    cancelled: Callable[[], bool] = never,
    eye: Eye = "",
    strokes_shown: bool = False,
) -> RenderInputs:
    """Read the inputs of an image of a depsgraph through a camera, flexible or not, without motion.

    size: of the whole image in pixels. pixel_error: overrides the camera's own. border: the part that is
    made. passes: names of ``shading.passes.PASSES``. may_be_empty, cancelled: as for ``read_scene``.
    scene: read from the depsgraph before, with the camera's layers. aspect: of the image as it is shown, by
    default from its size and the scene's pixel aspect. eye: of a stereoscopic scene. strokes_shown: whether
    Blender draws Grease Pencil over the image if the view is an ordinary one. Raises USER_ERRORS.
    """
    render = depsgraph.scene_eval.render
    evaluated = camera.evaluated_get(depsgraph)
    options = evaluated.scfpf
    aspect = aspect or shown_aspect(render, *size)
    layers = read_image_layers(camera, depsgraph, aspect, eye)
    projection = read_view(depsgraph, camera, aspect)
    plane = own_depth_plane(projection, evaluated, depsgraph, eye)
    is_ordinary = plane is not None and not layers.layers
    unseen = unseen_settings(projection, evaluated, eye)
    projection = replace(eye_projection(projection, evaluated, eye), layers=layers.layers)
    lens, lens_warning = read_lens(evaluated, projection, depsgraph, eye)
    if scene is None:
        scene = with_images(
            read_scene(
                depsgraph,
                may_be_empty,
                "UV" in passes,
                cancelled,
                layers.members,
                FACELESS - {"GREASEPENCIL"} if strokes_shown and is_ordinary else FACELESS,
            ),
            projection,
            transparent=render.film_transparent,
        )
    others = lens_warning, unseen, transparency_warning(scene, passes)
    others = (*others, *layers.warnings_of(scene.geometry, lens is not None), unbaked(camera.original))
    scene = replace(scene, warnings=(*scene.warnings, *filter(None, others)))
    marks = {}
    if any(name.startswith("CRYPTO") for name in passes):
        marks = {kind: identifiers(names) for kind, names in crypto_names(scene).items()}
    settings = frame_settings(
        depsgraph.scene_eval,
        size,
        samples=options.samples,
        pixel_error=options.pixel_error if pixel_error is None else pixel_error,
        border=border,
        passes=DataPasses(passes, plane, layers.planes, identifiers=marks),
        depth_of_field=lens,
    )
    return RenderInputs(projection, scene, settings, image_layers=layers, is_ordinary=is_ordinary)


def frame_settings(scene, size: tuple[int, int], **own) -> FrameSettings:
    """The settings of an image that an evaluated scene gives, with the fields ``own`` of the view."""
    render = scene.render
    width, height = size
    return FrameSettings(
        width,
        height,
        transparent=render.film_transparent,
        threads=render.threads if render.threads_mode == "FIXED" else 0,
        stylised=stylised_of(scene, width),
        **sampling_of(scene),
        **own,
    )


def read_view(depsgraph, camera, aspect: float, eye: Eye = "") -> Projection:
    """The projection of a camera, flexible or not, or of one of its eyes. Raises USER_ERRORS."""
    evaluated = camera.evaluated_get(depsgraph)
    if evaluated.scfpf.enabled:
        projection = read_projection(camera, depsgraph, aspect)
    else:
        projection = frustum_projection(evaluated, depsgraph, aspect)
    return eye_projection(projection, evaluated, eye)


def with_motion(
    inputs: RenderInputs,
    depsgraph,
    camera,
    set_frame: Callable[..., None],
    cancelled: Callable[[], bool] = never,
    eye: Eye = "",
) -> RenderInputs:
    """Add the frames around, if motion vectors are to be made, and the open shutter's moments, if it blurs.

    inputs: as read of the depsgraph, the camera and the eye. set_frame: evaluates the depsgraph at another
    time. cancelled(): whether the render is cancelled; then both may be missing.
    """

    def view():
        aspect = inputs.projection.aspect
        layers = read_image_layers(camera, depsgraph, aspect, eye)
        if layers.names != inputs.image_layers.names:
            # A layer is switched there: those of the frame itself have the numbers of its things.
            layers = inputs.image_layers
        projection = replace(read_view(depsgraph, camera, aspect, eye), layers=layers.layers)
        return projection, read_lens(camera.evaluated_get(depsgraph), projection, depsgraph, eye)[0]

    def everything():
        projection, lens = view()
        with_uv = inputs.scene.geometry.uv is not None
        there = read_scene(depsgraph, True, with_uv, cancelled, inputs.image_layers.members)
        there = with_images(there, projection, transparent=depsgraph.scene_eval.render.film_transparent)
        # The frame itself has one warning more, and each is shown once.
        return projection, replace(there, warnings=inputs.scene.warnings), lens

    settings = inputs.settings
    reader = MotionReader(
        scene=depsgraph.scene_eval,
        still=inputs.scene,
        set_frame=set_frame,
        read=everything,
        read_view=view,
        cancelled=cancelled,
    )
    if "VECTOR" in settings.passes.names and not cancelled():
        settings = replace(settings, passes=replace(settings.passes, neighbours=read_neighbours(reader)))
    moments: tuple[Moment, ...] = ()
    if depsgraph.view_layer_eval.use_motion_blur:
        moments = read_moments(reader, settings.samples)
    return replace(inputs, settings=settings, moments=moments)
