# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of others for the straight image: Cycles at one sample, Open3D and Mitsuba 3 for raw rays.

    python3 benchmarks/peers.py [--triangles N] [--markdown FILE]

Called by `dev.py bench --trade` too. Every time is CPU seconds of the whole process in one thread, the
least of several runs, divided by raw Embree's for the same rays. A peer that is not installed is named.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files, replace_section
from benchmarks.raw import raw_embree
from benchmarks.run import Image, raw_rays
from benchmarks.scenes import SCENES, Mesh, bent_projection
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.typing import Array

RUNS = 3


def least(work: Callable[[], object]) -> float:
    """CPU seconds of the quickest of several runs, after one that builds."""
    work()
    seconds = math.inf
    for _ in range(RUNS):
        start = process_time()
        work()
        seconds = min(seconds, process_time() - start)
    return seconds


def cycles(mesh: Mesh, image: Image) -> Callable[[], object]:
    """A render at one sample of a mesh that shines by itself, through Blender's own camera."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    vertices, triangles = mesh
    data = bpy.data.meshes.new("Mesh")
    data.from_pydata(vertices, [], triangles)
    scene.collection.objects.link(bpy.data.objects.new("Mesh", data))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.sensor_width, camera.data.lens = 36.0, 18.0
    camera.location.y = 1.5
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = image.width, image.height, 100
    render.use_persistent_data, render.threads_mode, render.threads = True, "FIXED", 1
    render.use_compositing = render.use_sequencer = False
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 1, False, 0
    scene.cycles.use_adaptive_sampling = False
    scene.view_layers[0].material_override = material = bpy.data.materials.new("Light")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    light, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(light.outputs[0], output.inputs["Surface"])
    render.filepath = str(Path(tempfile.gettempdir()) / "scfpf_peers.png")
    return lambda: bpy.ops.render.render()


def open3d(mesh: Mesh, rays: Array) -> Callable[[], object]:
    """Open3D's ray caster, which is Embree too."""
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    vertices, triangles = mesh
    scene.add_triangles(vertices.astype(np.float32), triangles.astype(np.uint32))
    given = open3d.core.Tensor(rays)
    return lambda: scene.cast_rays(given, nthreads=1)


def mitsuba(mesh: Mesh, rays: Array) -> Callable[[], object]:
    """Mitsuba 3 in its LLVM variant, the rays already on its side."""
    import drjit
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    vertices, triangles = mesh
    made = mitsuba.Mesh("mesh", len(vertices), len(triangles))
    parameters = mitsuba.traverse(made)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["faces"] = triangles.astype(np.uint32).ravel()
    parameters.update()
    scene = mitsuba.load_dict({"type": "scene", "mesh": made})
    origin, way = (mitsuba.Point3f(rays[:, :3].T.copy()), mitsuba.Vector3f(rays[:, 3:].T.copy()))
    ray = mitsuba.Ray3f(origin, way)

    def run() -> None:
        drjit.eval(scene.ray_intersect_preliminary(ray).t)
        drjit.sync_thread()

    return run


def measure(mesh: Mesh, image: Image) -> dict[str, float | str]:
    """Each peer's multiple of raw Embree, or why there is none."""
    scene = CastScene(*mesh)
    straight = raw_rays(scene, bent_projection(1, 0.0).transformed(scene.matrix), image)
    cast_raw = raw_embree(scene)
    raw = least(lambda: [cast_raw(*rays) for rays in straight])
    flat = np.concatenate([np.concatenate([start, way]).T for start, way, _ in straight])
    local = scene.vertices.T, scene.triangles
    peers: dict[str, Callable[[], Callable[[], object]]] = {
        "Cycles, 1 sample": lambda: cycles(mesh, image),
        "Open3D, raw rays": lambda: open3d(local, np.ascontiguousarray(flat)),
        "Mitsuba 3 LLVM, raw rays": lambda: mitsuba(local, flat),
    }
    result: dict[str, float | str] = {}
    for name, make in peers.items():
        try:
            result[name] = least(make()) / raw
        except (ImportError, OSError) as error:
            result[name] = f"cannot be had here: {error}".splitlines()[0]
    return result


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--triangles", type=int, default=100_000)
    parser.add_argument("--markdown", metavar="FILE", help="replace the table in FILE")
    options, _ = parser.parse_known_args(arguments)
    check_files(parser, document=options.markdown, sections=["peers"])
    lines = ["| scene and peer | times raw Embree |", "|---|---|"]
    print("\n".join(lines))
    for name, make in SCENES.items():
        for peer, figure in measure(make(options.triangles), Image(1280, 720)).items():
            shown = f"**not measured: {figure}**" if isinstance(figure, str) else f"{figure:.1f}×"
            lines.append(f"| {name}: {peer} | {shown} |")
            print(lines[-1], flush=True)
    if options.markdown:
        replace_section(options.markdown, "peers", lines)


if __name__ == "__main__":
    main()
