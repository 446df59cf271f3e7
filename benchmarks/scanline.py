# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed of the nodes preview: on the demo's street, as ratios to Blender's Lattice modifier, of small edits.

    python3 dev.py bench [--json FILE] [--quick]

Every time is the least of several evaluations of the dependency graph that take turns; drawing is not in it.
Ratios are of processor time, all threads together, which other work on the machine changes least.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from time import perf_counter, process_time

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files
from benchmarks.scenes import bent_projection
from demo.render_demo import ROOT, SHOTS, build_street, place_camera
from scfpf_addon import bridge
from scfpf_addon.bridge.blender import versions
from scfpf_addon.bridge.camera import flexible_camera
from scfpf_addon.bridge.render.type_registration import register_types
from scfpf_addon.projection.presets.preset import load_preset
from scfpf_addon.scanline.nodes.geometry_nodes import GeometryBuilder, node_group
from scfpf_addon.scanline.preview import preview, preview_data, preview_drafts, preview_properties
from scfpf_addon.scanline.remap import place_nodes
from scfpf_addon.scanline.remap.remap_nodes import remap_group
from scfpf_addon.scanline.table.table_object import table_object

# The goals, in times of the Lattice modifier.
REMAP_GOAL, WHOLE_GOAL = 3.0, 6.0
RUNS = 5
# Seconds by the clock on the demo's street, on two cores: switched on, a draft, the whole picture.
STREET_GOALS = {"perspective": (2.0, 0.15, 0.6), "around_the_car": (4.0, 0.3, 2.0)}


def sheet_mesh(volume, columns: int, rows: int, share: float = 0.9):
    """A waving sheet of triangles across that share of a volume, in its middle, all of it inside."""
    low, high = 0.5 - share / 2, 0.5 + share / 2
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(low, high, columns), np.linspace(low, high, rows)))
    t = 0.5 + 0.2 * np.sin(9 * x) * np.cos(7 * y)
    points = volume.evaluate(x, y, t).position.T.astype(np.float32)
    number = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    corners = np.stack([a, b, c, a, c, d], axis=-1).ravel().astype(np.int32)
    mesh = bpy.data.meshes.new("Sheet")
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(len(corners) // 3)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh


def vertices_group():
    """The remap of vertices alone: both guesses, and the mesh moved to where they led."""

    def build(nodes: GeometryBuilder, given):
        table = nodes.out("GeometryNodeObjectInfo", "Table", {"Object": given["Table"]}, "Geometry")
        view = place_nodes.view_inputs(nodes, table, given["Aspect"])
        position = nodes.out("GeometryNodeInputPosition", "Position", {})
        mesh = place_nodes.store_places(nodes, given["Geometry"], view | {"Point": position})
        box = nodes.attribute(place_nodes.BOX, "FLOAT_VECTOR")
        inputs = {"Geometry": mesh, "Position": box}
        return {"Geometry": nodes.out("GeometryNodeSetPosition", "Moved", inputs)}

    inputs = {
        "Geometry": ("Geometry", None, ""),
        "Table": ("Object", None, ""),
        "Aspect": ("Float", 1.0, ""),
    }
    return node_group("Benchmark: vertices", "", inputs, {"Geometry": "Geometry"}, build, modifier=True)


def with_group(name: str, mesh, group, table, aspect: float):
    """An object with a node group as its modifier."""
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    modifier = made.modifiers.new(name, "NODES")
    modifier.node_group = group
    for item in group.interface.items_tree:
        value = {"Table": table, "Aspect": aspect, "Picture Width": 1920.0}.get(item.name)
        if item.in_out == "INPUT" and value is not None:
            versions.set_modifier_input(modifier, item.identifier, value)
    modifier.node_group = group
    return made


def with_lattice(mesh):
    """An object deformed by a 4 × 4 × 4 lattice around all of it."""
    made = bpy.data.objects.new("Lattice Modifier", mesh)
    cage = bpy.data.objects.new("Cage", bpy.data.lattices.new("Cage"))
    cage.data.points_u = cage.data.points_v = cage.data.points_w = 4
    cage.scale = (100.0, 100.0, 100.0)
    for each in (made, cage):
        bpy.context.scene.collection.objects.link(each)
    made.modifiers.new("Lattice", "LATTICE").object = cage
    return made


def least_times(objects, runs: int) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds that each object's evaluation takes, the others hidden: by the clock, and of processors."""
    best, least = dict.fromkeys(objects, math.inf), dict.fromkeys(objects, math.inf)
    for _ in range(runs):
        for name, thing in objects.items():
            for other in objects.values():
                other.hide_viewport = other != thing
            bpy.context.view_layer.update()
            thing.update_tag()
            start, busy = perf_counter(), process_time()
            bpy.context.view_layer.update()
            best[name] = min(best[name], perf_counter() - start)
            least[name] = min(least[name], process_time() - busy)
    return best, least


def flexible_scene(projection):
    """An empty scene but for a flexible camera with a projection's planes; the camera."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.camera = camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    for plane in projection.volume.surfaces:
        size = {"width": plane.width, "height": plane.height}
        flexible_camera.add_surface(camera, "PLANE", matrix=plane.matrix, parameters=size)
    flexible_camera.make_flexible(camera)
    return camera


def measure_moves(projection, vertices: int, runs: int) -> dict:
    """A small object moved in a heavy scene, with the preview on, against all images made anew.

    Everything is in it that an artist waits for but the drawing, the add-on's handlers too.
    """
    camera = flexible_scene(projection)
    columns = round(math.sqrt(vertices))
    heavy = bpy.data.objects.new("Heavy", sheet_mesh(projection.volume, columns, columns))
    small = bpy.data.objects.new("Small", sheet_mesh(projection.volume, 20, 20, 0.1))
    for each in (heavy, small):
        bpy.context.scene.collection.objects.link(each)
    source = preview.switch_on(bpy.context, camera)
    moves = {"small": [small], "whole": [heavy, small], "off": [heavy, small]}
    best = dict.fromkeys(moves, math.inf)
    view_layer = bpy.context.view_layer
    for _ in range(runs):
        for name, moved in moves.items():
            if name == "off":
                preview.switch_off(source)
            view_layer.update()
            for each in moved:
                each.location.z += 1e-4
            start = perf_counter()
            view_layer.update()
            best[name] = min(best[name], perf_counter() - start)
        source = preview.switch_on(bpy.context, camera)
        view_layer.update()
    return {"triangles": len(heavy.data.polygons) + len(small.data.polygons), "seconds": best}


def street_camera(stem: str):
    """The flexible camera of a preset on the demo's street, as the demo places it."""
    scene, shot = build_street(), SHOTS[stem]
    preset = load_preset((ROOT / "presets" / f"{stem}.json").read_text(encoding="utf-8"))
    scene.render.resolution_x, scene.render.resolution_y = shot.size
    scene.camera = camera = bpy.data.objects.new(preset.name, bpy.data.cameras.new(preset.name))
    scene.collection.objects.link(camera)
    place_camera(camera, shot)
    flexible_camera.apply_preset(camera, preset, shot.size[0] / shot.size[1], shot.scale)
    bpy.context.view_layer.update()
    return camera


def measure_street(stem: str, runs: int) -> dict:
    """Switching the preview on, drafts while a surface moves, and the whole picture, on the demo's street.

    Seconds by the clock and of processors: the least of some runs, except for switching on, which has one.
    """
    camera, view_layer = street_camera(stem), bpy.context.view_layer
    timed = {"on": _timed(lambda: _switched_on(camera))}
    source = preview_data.preview_of(camera, bpy.context.scene)
    every = range(len(source.scfpf_preview.parts))
    surface = camera.scfpf.surfaces[-1].object

    def move():
        surface.location.x += 0.01
        view_layer.update()

    def make_whole():
        preview_drafts.finish()
        view_layer.update()

    drafts, wholes = [], []
    for _ in range(runs):
        preview_data.set_draft(source, every, True)
        move()
        drafts.append(_timed(move))
        wholes.append(_timed(make_whole))
    timed["draft"] = tuple(map(min, zip(*drafts, strict=True)))
    timed["whole"] = tuple(map(min, zip(*wholes, strict=True)))
    return {"preset": stem, "seconds": timed}


def _switched_on(camera) -> None:
    preview.switch_on(bpy.context, camera)
    bpy.context.view_layer.update()


def _timed(function) -> tuple[float, float]:
    start, busy = perf_counter(), process_time()
    function()
    return perf_counter() - start, process_time() - busy


def report_street(result: dict) -> None:
    """Print one line of figures beside their goals."""
    goals = STREET_GOALS[result["preset"]]
    figures = ", ".join(
        f"{title} {clock:.2f} s, {busy:.2f} s of processors (goal {goal:g} s)"
        for (title, (clock, busy)), goal in zip(result["seconds"].items(), goals, strict=True)
    )
    print(f"  {result['preset']:15s} {figures}", flush=True)


def report_moves(result: dict) -> None:
    """Print one line of figures."""
    small, whole, off = (result["seconds"][name] for name in ("small", "whole", "off"))
    print(
        f"  {result['triangles']:>9,} triangles: a small object moved {small * 1e3:6.1f} ms, everything "
        f"{whole * 1e3:6.1f} ms, {whole / small:.0f} × as long; preview off {off * 1e3:.1f} ms"
    )


def measure(title: str, projection, vertices: int, runs: int) -> dict:
    """One size of mesh through one volume."""
    camera = flexible_scene(projection)
    table = table_object(camera)
    columns = round(math.sqrt(vertices))
    mesh = sheet_mesh(projection.volume, columns, columns)
    aspect = projection.aspect
    objects = {
        "lattice": with_lattice(mesh),
        "vertices": with_group("Vertices", mesh, vertices_group(), table, aspect),
        "whole": with_group("Whole", mesh, remap_group(), table, aspect),
    }
    seconds, processor = least_times(objects, runs)
    result = {"volume": title, "vertices": len(mesh.vertices), "triangles": len(mesh.polygons)}
    return result | {"seconds": seconds, "processor": processor}


def report(result: dict) -> None:
    """Print one line of figures."""
    seconds, processor = result["seconds"], result["processor"]
    lattice = processor["lattice"]
    print(
        f"  {result['volume']:14s} {result['vertices']:>9,} vertices, {result['triangles']:>9,} triangles: "
        f"Lattice {lattice * 1e3:6.1f} ms; vertices {processor['vertices'] / lattice:5.2f} × "
        f"(goal {REMAP_GOAL:g}), whole chain {processor['whole'] / lattice:5.2f} × (goal {WHOLE_GOAL:g}), "
        f"{1 / seconds['whole']:.1f} frames a second"
    )


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="add the figures to FILE")
    parser.add_argument("--quick", action="store_true", help="smaller meshes, fewer runs")
    options, _ = parser.parse_known_args()
    check_files(parser, written=options.json)
    register_types((*bridge.TYPES, preview_properties))
    bridge.register()
    sizes = (10_000, 100_000) if options.quick else (10_000, 100_000, 500_000, 1_000_000)
    print("\nnodes preview: evaluation in times of the Lattice modifier on the same mesh")
    results = []
    for title, projection in (
        ("straight", bent_projection(1, 0.0)),
        ("bent by 60°", bent_projection(2, 1.05)),
    ):
        for size in sizes:
            results.append(measure(title, projection, size, 2 if options.quick else RUNS))
            report(results[-1])
    preview.register()
    print("\nnodes preview: the demo's street, 274,000 triangles, by the clock on two cores")
    # As if a window were there to watch drafts.
    preview_drafts.is_live = lambda: True
    street = [measure_street(stem, 2 if options.quick else RUNS) for stem in STREET_GOALS]
    for one in street:
        report_street(one)
    preview_drafts.is_live = lambda: False
    print("\nnodes preview: a small object moved in a heavy scene")
    moves = []
    for size in sizes[1:3]:
        moves.append(measure_moves(bent_projection(2, 1.05), size, 2 if options.quick else RUNS))
        report_moves(moves[-1])
    if options.json:
        file = Path(options.json)
        figures = json.loads(file.read_text()) if file.exists() else {}
        file.write_text(
            json.dumps(figures | {"scanline": results, "moves": moves, "street": street}, indent=1) + "\n"
        )


if __name__ == "__main__":
    main()
