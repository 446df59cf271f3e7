# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection mapping with Blender's objects: surfaces, a video projector's images, and a mesh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.mappings.calibrated import CalibratedLens
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ...shading.picking.video_projector import sampled, seen_places
from ..blender.atomic_files import replacing
from ..blender.packing import pack
from ..camera.ordinary_camera import frustum_projection
from ..camera.read_projection import read_projection
from ..mappings.mapping_edits import calibrated_lens
from ..scene.mesh_arrays import of_mesh, read_mesh

MAP_NAME, PICTURE_NAME = "SCFPF Video Projector Map", "SCFPF Video Projector Picture"


def lit_surfaces(objects, depsgraph) -> tuple[np.ndarray, np.ndarray]:
    """The vertices (V, 3) in world space and triangles (T, 3) of objects' meshes. Raises UserError."""
    vertices, triangles, count = [], [], 0
    for obj in objects:
        evaluated = obj.evaluated_get(depsgraph)
        mesh = of_mesh(evaluated, read_mesh)
        matrix = np.array(evaluated.matrix_world, np.float64)
        vertices.append(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3])
        triangles.append(mesh.triangles + count)
        count += len(mesh.vertices)
    if not sum(map(len, triangles)):
        raise UserError("The selected objects have no faces to project on: select a mesh")
    return np.concatenate(vertices), np.concatenate(triangles)


def device_size(camera) -> tuple[int, int] | None:
    """The size of a video projector's image by its calibrated lens, or None without one. Raises UserError."""
    for mapping in camera.scfpf.mappings if camera.scfpf.enabled else ():
        if mapping.enabled and mapping.kind == "CALIBRATION":
            lens: CalibratedLens = calibrated_lens(mapping.calibration)
            return round(lens.size[0]), round(lens.size[1])
    return None


def device_view(camera, depsgraph, aspect: float) -> Projection:
    """The projection of a video projector, in world space, for an image of its own shape. Raises UserError.

    aspect: width / height of the device's image. An ordinary camera's frustum has the shape of the scene's
    image: it keeps the side to which its sensor is fitted.
    """
    evaluated = camera.evaluated_get(depsgraph)
    if evaluated.scfpf.enabled:
        return read_projection(camera, depsgraph, aspect)
    projection = frustum_projection(evaluated, depsgraph, aspect)
    fit = evaluated.data.sensor_fit
    ends = []
    for end in projection.volume.surfaces:
        kept = {"HORIZONTAL": end.width, "VERTICAL": end.height}.get(fit, max(end.width, end.height))
        is_wide = fit == "HORIZONTAL" or (fit == "AUTO" and aspect >= 1)
        width, height = (kept, kept / aspect) if is_wide else (kept * aspect, kept)
        ends.append(replace(end, width=width, height=height))
    return replace(projection, volume=replace(projection.volume, surfaces=tuple(ends)))


def write_map(places: np.ndarray, shown: np.ndarray):
    """A new ST map of a video projector's pixels; and a message if it cannot be stored."""
    pixels = np.zeros((*shown.shape, 4), np.float32)
    pixels[..., :2], pixels[..., 3] = places, shown
    return _image(MAP_NAME, pixels, is_data=True)


def write_picture(image, places: np.ndarray, shown: np.ndarray):
    """A new image of what a video projector shows, from the viewer's image; and a message, see ``write_map``.

    Raises UserError for an image without pixels.
    """
    width, height = image.size
    if min(width, height) < 1 or image.channels < 3:
        raise UserError(
            "'{0}' has no pixels: render the viewer's picture, or choose another image", image.name
        )
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, -1)
    result = np.zeros((*shown.shape, 4), np.float32)
    result[..., :3], result[..., 3] = sampled(pixels[..., :3], places, shown), shown
    made, warning = _image(PICTURE_NAME, result, is_data=False)
    if image.is_float:
        made.colorspace_settings.name = image.colorspace_settings.name
    return made, warning


def _image(name: str, pixels: np.ndarray, is_data: bool):
    """A new float image of pixels (H, W, 4), row 0 at the bottom; and a message if it cannot be stored."""
    height, width = pixels.shape[:2]
    result = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True, is_data=is_data)
    # With straight alpha Blender would multiply the pixels when it opens the file again.
    result.alpha_mode = "PREMUL"
    result.pixels.foreach_set(pixels.ravel())
    result.update()
    return result, pack(result)


def write_content_mesh(
    path: Path, vertices: np.ndarray, triangles: np.ndarray, viewer: Projection, size: tuple[int, int]
) -> tuple[int, float]:
    """Write surfaces as an OBJ file whose UV map is the viewer's image.

    Triangles with a vertex outside of that image are left out. size: of the viewer's image. Returns how many
    were left out, and by how many pixels the UV map is off at the middle of a triangle, at most: between
    vertices it is linear, the view is not. Raises OSError, and UserError if the viewer sees no triangle.
    """
    scene = CastScene(vertices, triangles)
    pixel = 1 / size[0], 1 / size[1]
    found = seen_places(scene, viewer, vertices.T, pixel, visible_only=False)
    kept = triangles[found.shown[triangles].all(axis=1)]
    if not len(kept):
        raise UserError("The scene's camera sees no whole face of the selected objects: aim it at them")
    uv = np.stack([found.x, found.y], axis=1)
    middles = seen_places(scene, viewer, vertices[kept].mean(axis=1).T, pixel, visible_only=False)
    off = (uv[kept].mean(axis=1) - np.stack([middles.x, middles.y], axis=1)) * np.array(size)
    error = float(np.hypot(*off[middles.shown].T).max(initial=0.0))
    used, numbers = np.unique(kept, return_inverse=True)
    corners = numbers.reshape(-1, 3) + 1
    # OBJ files are read with Y up, as Blender's own exporter writes them.
    across, ahead, up = vertices[used].T
    with replacing(path) as part, part.open("w", encoding="ascii", newline="\n") as file:
        file.write("# Surfaces whose UV map is the viewer's picture\n")
        np.savetxt(file, np.stack([across, up, -ahead], axis=1), "v %.9g %.9g %.9g")
        np.savetxt(file, uv[used], "vt %.9g %.9g")
        np.savetxt(file, np.repeat(corners, 2, axis=1), "f %d/%d %d/%d %d/%d")
    return len(triangles) - len(kept), error
