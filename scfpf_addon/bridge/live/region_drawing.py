# SPDX-License-Identifier: GPL-3.0-or-later
"""Images and texts drawn in a region of a 3D viewport, in its pixels, by handlers of the stage POST_VIEW."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import blf
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...shading.typing import Single
from ..render.view_painter import Rectangle

# The text of a message: its size in points, and its place from the frame's left bottom corner.
TEXT_SIZE, TEXT_MARGIN = 12, 12

VERTEX = """
void main() {
  place = texCoord;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0);
}
"""
# Blender takes what handlers draw for linear, and shows it with this exponent, not with that of sRGB
# (intern/opencolorio/gpu_shader_display_transform.glsl, "Blend with overlay").
FRAGMENT = """
void main() {
  vec4 color = texture(image, place);
  vec3 display = max(color.rgb, vec3(0.0)) / max(color.a, 1e-6);
  FragColor = vec4(pow(display, vec3(2.2)) * color.a, color.a);
}
"""


@cache
def _shader() -> gpu.types.GPUShader:
    """The shader of textures of display-encoded, premultiplied colours."""
    info = gpu.types.GPUShaderCreateInfo()
    between = gpu.types.GPUStageInterfaceInfo("scfpf_live_image")
    between.smooth("VEC2", "place")
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.sampler(0, "FLOAT_2D", "image")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_in(1, "VEC2", "texCoord")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "FragColor")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)


def image_texture(pixels: Single) -> gpu.types.GPUTexture:
    """A texture of an image (H, W, 4), display-encoded and premultiplied."""
    height, width = pixels.shape[:2]
    data = gpu.types.Buffer("FLOAT", width * height * 4, np.ravel(pixels))
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=data)


@contextmanager
def pixel_space(region) -> Iterator[None]:
    """Within this context a region's pixels are the units of what is drawn."""
    matrix = Matrix.Diagonal((2.0 / region.width, 2.0 / region.height, 1.0, 1.0))
    matrix[0][3] = matrix[1][3] = -1.0
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(Matrix())
        gpu.matrix.load_projection_matrix(matrix)
        yield


def draw_image(texture: gpu.types.GPUTexture, rectangle: Rectangle) -> None:
    """Draw a texture of ``image_texture``; its own alpha covers what is behind."""
    left, bottom, width, height = rectangle
    right, top = left + width, bottom + height
    shader = _shader()
    batch = batch_for_shader(
        shader,
        "TRIS",
        {
            "pos": ((left, bottom), (right, bottom), (right, top), (left, top)),
            "texCoord": ((0, 0), (1, 0), (1, 1), (0, 1)),
        },
        indices=((0, 1, 2), (0, 2, 3)),
    )
    gpu.state.blend_set("ALPHA_PREMULT")
    shader.bind()
    shader.uniform_sampler("image", texture)
    batch.draw(shader)
    gpu.state.blend_set("NONE")


def draw_text(text: str, rectangle: Rectangle, scale: float) -> None:
    """Draw a line of text in the left bottom corner of a rectangle. scale: of the user interface."""
    font, margin = 0, TEXT_MARGIN * scale
    blf.size(font, TEXT_SIZE * scale)
    blf.color(font, 1.0, 1.0, 1.0, 1.0)
    blf.enable(font, blf.SHADOW)
    blf.shadow(font, 3, 0.0, 0.0, 0.0, 0.8)
    blf.position(font, max(rectangle.left, 0.0) + margin, max(rectangle.bottom, 0.0) + margin, 0.0)
    blf.draw(font, text)
    blf.disable(font, blf.SHADOW)
