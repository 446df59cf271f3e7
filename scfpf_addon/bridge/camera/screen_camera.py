# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera whose image is made for a screen: straight projectors run through the screen, away from an eye.

The square of the screen's UV map is the image. Shown on the screen, the image looks from the eye as the scene
does without the screen. Projectors begin at the screen or, for things that pop out of it, near the eye; then
no image shows the screen itself. Both surfaces are the screen's own mesh, scaled away from the camera by
Geometry Nodes: they follow the screen, its modifiers, and the camera, which is the eye.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Vector

from ...projection.user_error import UserError
from ..blender.modifier_inputs import input_identifiers, set_inputs
from ..blender.node_builder import NodeBuilder
from ..surfaces.uv_mesh import read_uv_mesh
from ..volume.screens import EYE, GROUP_NAME, SCALE, SCREEN
from .flexible_camera import NewSurface, make_flexible, replace_surfaces

# Projectors begin this share of the screen's distance behind it, so that they do not meet the screen itself.
BEHIND = 1e-4
# With things that pop out, they begin at this share of the way from the eye to the screen.
NEAR_EYE = 0.01
# The far surface lies at this multiple of the farthest point's distance, and of the screen's at least.
FAR_MARGIN, LEAST_FAR = 1.25, 2.0
# An eye that is nearer than this share of the screen's size lies on the screen.
ON_SCREEN = 1e-4


def screen_points(screen, depsgraph):
    """The vertices of a screen in world space, (3, N). Raises UserError if it cannot be a UV mesh."""
    evaluated = screen.evaluated_get(depsgraph)
    return read_uv_mesh(evaluated, np.array(evaluated.matrix_world, np.float64)).hull()


def look_at(camera, eye, points) -> None:
    """Put a camera at a place (3,), and turn it to the middle of points (3, N), all in world space."""
    middle = (points.max(axis=1) + points.min(axis=1)) / 2
    turn = Vector((middle - eye).tolist()).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    turn.translation = Vector(np.asarray(eye).tolist())
    camera.matrix_world = turn


def volume_from_screen(camera, screen, points, scene_corners, pops_out: bool) -> None:
    """Replace a camera's volume by what can be seen through a screen from the camera's place.

    points: (3, N), the screen's vertices. scene_corners: (M, 3), which the volume reaches beyond. Both in
    world space. pops_out: whether the volume begins near the eye, not behind the screen. Raises UserError if
    the camera stands on the screen.
    """
    eye = np.array(camera.matrix_world.translation, np.float64)
    distances = np.linalg.norm(points - eye[:, None], axis=0)
    nearest = float(distances.min())
    if nearest <= ON_SCREEN * float(np.ptp(points, axis=1).max()):
        raise UserError(
            "The eye is on '{0}': move the camera or empty that is the eye, or the 3D cursor, away",
            screen.name,
        )
    farthest = float(np.linalg.norm(np.asarray(scene_corners) - eye, axis=1).max(initial=0.0))
    far = max(FAR_MARGIN * farthest / nearest, LEAST_FAR)
    replace_surfaces(
        camera, [NewSurface(name, "UV_MESH", np.eye(4)) for name in ("Near" if pops_out else "Screen", "Far")]
    )
    group = _screen_group()
    near = NEAR_EYE if pops_out else 1.0 + BEHIND
    for slot, scale in zip(camera.scfpf.surfaces, (near, far), strict=True):
        modifier = slot.object.modifiers.new(GROUP_NAME, "NODES")
        modifier.node_group = group
        set_inputs(modifier, {SCREEN: screen, EYE: camera, SCALE: scale})
    settings = camera.scfpf
    settings.basis, settings.reparameterisation = "BEZIER", "RECTANGLE"
    settings.fit = "NONE"
    make_flexible(camera)


def _screen_group():
    """The node group of a screen's surfaces: the file's own if it is whole, else a new one."""
    existing = bpy.data.node_groups.get((GROUP_NAME, None))
    if existing and list(input_identifiers(existing)) == [SCREEN, EYE, SCALE]:
        return existing
    tree = bpy.data.node_groups.new(GROUP_NAME, "GeometryNodeTree")
    tree.is_modifier = True
    tree.description = "A screen's mesh, scaled away from an eye: a control surface of Camera from Screen"
    tree.interface.new_socket("Mesh", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    for name, text in ((SCREEN, "The mesh of the screen"), (EYE, "The object from which it is looked at")):
        socket = tree.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketObject")
        socket.description = text
    scale = tree.interface.new_socket(SCALE, in_out="INPUT", socket_type="NodeSocketFloat")
    scale.description = "Distance of the surface from the eye, as a multiple of the screen's"
    scale.default_value, scale.min_value = 1.0, 0.0
    nodes = NodeBuilder(tree)
    given = nodes.node("NodeGroupInput", "Parameters", {}).outputs
    info = {"transform_space": "RELATIVE"}
    screen = nodes.node("GeometryNodeObjectInfo", SCREEN, {"Object": given[SCREEN]}, **info)
    eye = nodes.node("GeometryNodeObjectInfo", EYE, {"Object": given[EYE]}, **info).outputs["Location"]
    position = nodes.node("GeometryNodeInputPosition", "Position", {}).outputs[0]
    away = nodes.node("ShaderNodeVectorMath", "From the Eye", {0: position, 1: eye}, operation="SUBTRACT")
    scaled = nodes.node(
        "ShaderNodeVectorMath",
        "Scaled",
        {"Vector": away.outputs[0], "Scale": given[SCALE]},
        operation="SCALE",
    )
    moved = nodes.node("ShaderNodeVectorMath", "Moved", {0: scaled.outputs[0], 1: eye}, operation="ADD")
    mesh = nodes.node(
        "GeometryNodeSetPosition",
        "Set Position",
        {"Geometry": screen.outputs["Geometry"], "Position": moved.outputs[0]},
    )
    nodes.node("NodeGroupOutput", "Surface", {"Mesh": mesh.outputs["Geometry"]})
    return tree
