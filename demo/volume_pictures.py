# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a viewing volume, as in the paper: its plan and side view, and its lines in the scene."""

from __future__ import annotations

import importlib
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .mesh import Array, material

# Inches; at DPI as wide as a column of the gallery.
DIAGRAM_SIZE, DPI = (6.4, 3.6), 100
GREEN, BLUE, RED = "#1b7f2c", "#3f6fd0", "#c0392b"
# Half the thickness of a line as a share of its distance from the viewer: about three pixels of 800.
LINE_SHARE = {"PROJECTOR": 0.0009, "FOLD": 0.0009, "SURFACE": 0.0012, "RIM": 0.0022}
# Segments shorter than this share of the whole drawing have no direction.
SHORTEST = 1e-7
LINE_COLOURS = {
    "PROJECTOR": (0.02, 0.10, 0.80),
    "FOLD": (0.80, 0.02, 0.02),
    "SURFACE": (0.03, 0.55, 0.08),
    "RIM": (0.0, 0.32, 0.03),
}
SET_UP_SIZE, SET_UP_LENS, SET_UP_MARGIN = (800, 560), 60.0, 1.06


def volume_lines(diagram, projection, projectors: tuple[int, int], reach: float) -> dict[str, Array]:
    """Segments (S, 2, 3) by role, clipped at ``reach``; diagram: the add-on's module of that name."""
    straight, folded, dashes = diagram.parted_projector_lines(projection, *projectors)
    count = len(projection.volume.surfaces)
    lines = {
        "SURFACE": np.concatenate([diagram.surface_lines(projection, i) for i in range(count)]),
        "PROJECTOR": straight,
        "FOLD": np.concatenate([folded, dashes]),
        "RIM": np.concatenate([diagram.surface_lines(projection, i, 1) for i in range(count)]),
    }
    return {role: _within(np.asarray(own, np.float64), reach) for role, own in lines.items()}


def _within(ends: Array, reach: float) -> Array:
    """Segments (S, 2, 3) clipped to a ball around the origin, without those of length 0."""
    start, way = ends[:, 0], ends[:, 1] - ends[:, 0]
    a, b, c = (way**2).sum(axis=1), (start * way).sum(axis=1), (start**2).sum(axis=1) - min(reach, 1e9) ** 2
    half = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    shares = np.clip(np.stack([-b - half, -b + half], axis=1) / np.maximum(a, 1e-30)[:, None], 0.0, 1.0)
    cut = start[:, None] + shares[:, :, None] * way[:, None]
    return cut[np.linalg.norm(cut[:, 1] - cut[:, 0], axis=1) > SHORTEST * np.abs(ends).max(initial=0.0)]


def draw_diagram(module: str, projection, projectors: tuple[int, int], reach: float, path: Path) -> None:
    """Write the plan and side view of a volume in camera space, with its control surfaces labelled."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.collections import LineCollection

    diagram = importlib.import_module(f"{module}.scfpf_addon.projection.diagrams.diagram")
    lines = volume_lines(diagram, projection, projectors, reach)
    styles = {"SURFACE": (GREEN, 0.4), "PROJECTOR": (BLUE, 0.7), "FOLD": (RED, 0.7), "RIM": (GREEN, 2.0)}
    figure, panes = pyplot.subplots(1, 2, figsize=DIAGRAM_SIZE, layout="constrained")
    for pane, title, axis in zip(panes, ("from above", "from the right"), (0, 1), strict=True):
        for role, (colour, width) in styles.items():
            flat = np.stack([-lines[role][..., 2], lines[role][..., axis]], axis=-1)
            # Depth runs upwards in the plan and to the right in the side view.
            pane.add_collection(
                LineCollection(flat[..., ::-1] if axis == 0 else flat, colors=colour, linewidths=width)
            )
        for index in range(len(projection.volume.surfaces)):
            points = diagram.surface_lines(projection, index, 1).reshape(-1, 3)
            if not len(points):
                points = projection.volume.surfaces[index].evaluate(np.zeros(1), np.zeros(1)).position.T
            points = points[np.linalg.norm(points, axis=1) <= reach]
            if not len(points):
                continue
            depth, across = -points[:, 2], points[:, axis]
            at = (
                (across.max(), depth[across.argmax()])
                if axis == 0
                else (depth[across.argmax()], across.max())
            )
            pane.annotate(f"$Q_{index}$", at, (4, 4), textcoords="offset points", color=GREEN, fontsize=12)
        pane.set_title(title, fontsize=9, color="0.35")
        pane.set_aspect("equal", "datalim")
        pane.autoscale_view()
        pane.margins(0.08)
        pane.axis("off")
    figure.savefig(path, dpi=DPI)
    pyplot.close(figure)


def _tubes(ends: Array, radii: Array) -> tuple[Array, Array]:
    """Vertices and quads of square bars along segments with ends (S, 2, 3) and half thicknesses (S, 2)."""
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    across = np.stack([side, np.cross(along, side)], axis=1)
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    offsets = np.einsum("kc,scd->skd", corners, across)
    vertices = ends[:, :, None] + radii[:, :, None, None] * offsets[:, None]
    quads = [(k, (k + 1) % 4, 4 + (k + 1) % 4, 4 + k) for k in range(4)]
    return vertices.reshape(-1, 3), (8 * np.arange(len(ends))[:, None, None] + quads).reshape(-1, 4)


def _stand(points: Array, camera: Matrix, direction: tuple[float, float], aspect: float) -> Matrix:
    """The matrix of an ordinary camera whose view all points (N, 3) fill.

    direction: (degrees to the right of the flexible camera's back, degrees above it).
    """
    turn, rise = np.radians(direction)
    back = camera.to_3x3().normalized() @ Vector((np.sin(turn), 0.0, np.cos(turn)))
    back.z = 0.0
    back = (back.normalized() * np.cos(rise) + Vector((0.0, 0.0, 1.0)) * np.sin(rise)).normalized()
    turned = np.array(back.to_track_quat("Z", "Y").to_matrix(), np.float64)
    own = points @ turned
    half = np.array([1.0, 1.0 / aspect]) * 18.0 / SET_UP_LENS / SET_UP_MARGIN
    # The frustum's planes that touch the points cross above the middle of the view.
    high = (own[:, :2] + own[:, 2:] * half).max(axis=0)
    low = (own[:, :2] - own[:, 2:] * half).min(axis=0)
    place = np.array([*((high + low) / 2), ((high - low) / (2 * half)).max()])
    return Matrix.Translation(turned @ place) @ Matrix(turned.tolist()).to_4x4()


def add_set_up(
    module: str,
    scene: bpy.types.Scene,
    camera,
    projection,
    projectors: tuple[int, int],
    reach: float,
    direction,
) -> bpy.types.Object:
    """Draw a camera's volume in a scene as bars, and give the scene an ordinary camera that sees them all.

    projection: in the flexible camera's own space. Returns the ordinary camera.
    """
    diagram = importlib.import_module(f"{module}.scfpf_addon.projection.diagrams.diagram")
    matrix = np.array(camera.matrix_world, np.float64)
    lines = {
        role: own @ matrix[:3, :3].T + matrix[:3, 3]
        for role, own in volume_lines(diagram, projection, projectors, reach).items()
        if len(own)
    }
    scene.render.resolution_x, scene.render.resolution_y = SET_UP_SIZE
    scene.render.film_transparent = True
    aspect = SET_UP_SIZE[0] / SET_UP_SIZE[1]
    lens = bpy.data.cameras.new("Set-up")
    lens.lens, lens.clip_start, lens.clip_end = SET_UP_LENS, 0.1, 5000.0
    viewer = bpy.data.objects.new("Set-up", lens)
    everything = np.concatenate([ends.reshape(-1, 3) for ends in lines.values()])
    viewer.matrix_world = _stand(everything, camera.matrix_world, direction, aspect)
    scene.collection.objects.link(viewer)
    scene.camera = viewer
    eye = np.array(viewer.matrix_world.translation)
    for role, ends in lines.items():
        radii = LINE_SHARE[role] * np.linalg.norm(ends - eye, axis=2)
        vertices, quads = _tubes(ends, radii)
        mesh = bpy.data.meshes.new(role.title())
        mesh.from_pydata(vertices, [], quads.tolist())
        mesh.materials.append(material(role.title(), LINE_COLOURS[role], emission=1.0))
        scene.collection.objects.link(bpy.data.objects.new(role.title(), mesh))
    return viewer
