# SPDX-License-Identifier: GPL-3.0-or-later
"""Latency and rate of Live View on the demo's street, for every preset.

    python3 dev.py bench --live [--only PRESET] [--json FILE] [--markdown docs/performance.md] [--headless]

Without a window, a surface of each preset is moved step by step, as a drag does; then vertices, sliders,
objects and the animation of two presets. Then the same two are dragged by the mouse in a Blender with a
window, beside Blender's own Solid view of the same scene, which also writes the README's moving picture.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import shutil
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.document import check_files, replace_section
from demo.render_demo import MODULE, Shot, build_street, enable_add_on, place_camera, scratch_profile
from demo.render_thumbnails import OWN, USUAL
from devtools import environments, package, window
from devtools.environments import ROOT

# The width in pixels of the camera's frame in the viewport.
WIDTH = 1200
STEPS = 20
# A step of a drag, as a share of the distance from the first control surface to the last.
STEP_SHARE = 0.004
# Goals: seconds to the first image after a change, images a second, seconds to the final one, and seconds
# to the first image after an object of many triangles has moved or its mesh has changed.
FIRST_GOAL, RATE_GOAL, FINAL_GOAL, OBJECT_GOAL = 0.1, 10.0, 1.0, 0.3
OBJECT_TRIANGLES = 100_000
# Faces along each side of a surface whose vertices are dragged.
GRID = 9
# Presets that are changed in other ways too, and dragged in a window.
CLOSELY = ("perspective", "around_the_car")
PATIENCE = 30.0
SECTION = "live"
SCENARIO = "scenarios_live_drag"
FIGURES, RECORDING = "live.json", "live-drag.webp"
LIMIT = 900.0

Row = dict[str, Any]


class Bench(NamedTuple):
    """A camera on the street with the live view of a viewport that nobody sees."""

    camera: Any
    live: Any
    size: tuple[int, int]

    @property
    def space(self) -> Any:
        """A 3D viewport of the file, whose Solid shading the images have."""
        import bpy

        areas = (area for screen in bpy.data.screens for area in screen.areas)
        return next(area.spaces.active for area in areas if area.type == "VIEW_3D")

    def ask(self) -> None:
        """Ask for the image, as the viewport's drawing does, and wait for the first one."""
        import bpy

        modules = [
            importlib.import_module(f"{MODULE}.scfpf_addon.{name}")
            for name in ("shading.live.cast_live", "bridge.render.view_painter")
        ]
        frame = modules[1].Rectangle(0.0, 0.0, *map(float, self.size))
        part = modules[0].LiveWindow(0.0, 0.0, 1.0, 1.0, *self.size)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        self.live.request(depsgraph, self.camera, frame, part, frame, self.space)
        if not self.live.painter.wait(PATIENCE) or self.live.painter.message:
            sys.exit(f"{self.camera.name}: {self.live.painter.message or 'no image came'}")

    def finished(self) -> float:
        """Wait for the final image; the seconds that it took."""
        begun = time.perf_counter()
        while self.live.painter.image.step > 1.0:
            time.sleep(0.002)
            if time.perf_counter() - begun > PATIENCE:
                sys.exit(f"{self.camera.name}: no final image came")
        return time.perf_counter() - begun


def prepared(scene, camera, path: Path) -> Bench:
    """The street's camera with a preset, and its live view."""
    import bpy

    presets, flexible, live_view = (
        importlib.import_module(f"{MODULE}.scfpf_addon.{name}")
        for name in ("projection.presets.preset", "bridge.camera.flexible_camera", "bridge.live.live_view")
    )
    shot: Shot = OWN.get(path.stem, USUAL)
    scene.render.resolution_x, scene.render.resolution_y = shot.size
    place_camera(camera, shot)
    aspect = shot.size[0] / shot.size[1]
    flexible.apply_preset(camera, presets.read_preset(path), aspect, shot.scale)
    bpy.context.view_layer.update()
    bench = Bench(camera, live_view.LiveView(), (WIDTH, round(WIDTH / aspect)))
    bench.space.shading.color_type = "MATERIAL"
    bench.ask()
    bench.finished()
    return bench


def measured(bench: Bench, change: Callable[[int], None]) -> Row:
    """The figures of ``STEPS`` changes, one after the other: change(number) makes one."""
    import bpy

    latencies, coarseness = [], []
    busy = time.process_time()
    for number in range(STEPS):
        begun = time.perf_counter()
        change(number)
        bpy.context.view_layer.update()
        bench.ask()
        latencies.append(time.perf_counter() - begun)
        coarseness.append(bench.live.painter.image.step)
    busy = time.process_time() - busy
    return {
        "median": statistics.median(latencies),
        "longest": max(latencies),
        "rate": STEPS / sum(latencies),
        "processor": busy / STEPS,
        "coarseness": statistics.median(coarseness),
        "final": bench.finished(),
    }


def surface_drag(bench: Bench) -> Callable[[int], None]:
    """Move the last control surface to and fro."""
    surfaces = [slot.object for slot in bench.camera.scfpf.surfaces]
    ends = surfaces[0].matrix_world.translation, surfaces[-1].matrix_world.translation
    step = STEP_SHARE * max((ends[1] - ends[0]).length, 1.0)

    def change(number: int) -> None:
        surfaces[-1].location.x += step * math.copysign(1.0, 0.25 * STEPS - number % (STEPS // 2))

    return change


def slider(bench: Bench) -> Callable[[int], None]:
    """Change the range of u, a slider of the panel."""

    def change(number: int) -> None:
        bench.camera.scfpf.u_range[1] = 1.0 - 0.01 * (number % 10)

    return change


def playback(bench: Bench) -> Callable[[int], None]:
    """Play an animation of the last surface."""
    import bpy

    surface = bench.camera.scfpf.surfaces[-1].object
    for frame in (1, STEPS):
        surface.location.z += 0.1 * frame / STEPS
        surface.keyframe_insert("location", frame=frame)

    def change(number: int) -> None:
        bpy.context.scene.frame_set(1 + number)

    return change


def heavy_object(scene):
    """A grid of OBJECT_TRIANGLES triangles above the street."""
    import bpy

    many = round((OBJECT_TRIANGLES / 2) ** 0.5)
    bpy.ops.mesh.primitive_grid_add(
        x_subdivisions=many, y_subdivisions=many, size=3.0, location=(0.0, 0.0, 3.0)
    )
    return bpy.context.object


def object_drag(made) -> Callable[[int], None]:
    """Move an object."""

    def change(number: int) -> None:
        made.location.x = 0.02 * number

    return change


def mesh_edit(made) -> Callable[[int], None]:
    """Move a vertex of an object's mesh."""

    def change(number: int) -> None:
        made.data.vertices[number].co.z += 0.1
        made.data.update()

    return change


def as_mesh(camera):
    """The last surface of a camera, as a grid whose vertices can be dragged."""
    import bpy

    edits = importlib.import_module(f"{MODULE}.scfpf_addon.bridge.camera.surface_edits")
    last = len(camera.scfpf.surfaces) - 1
    if camera.scfpf.surfaces[last].object.scfpf_surface.kind != "GRID":
        edits.convert_to_grid(camera, bpy.context.evaluated_depsgraph_get(), last, GRID, GRID, 1.0)
    return camera.scfpf.surfaces[last].object


def vertex_drag(made) -> Callable[[int], None]:
    """Enter Edit Mode and drag a vertex of an object."""
    import bmesh
    import bpy

    for chosen in bpy.context.selected_objects:
        chosen.select_set(False)
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")

    def change(number: int) -> None:
        mesh = bmesh.from_edit_mesh(made.data)
        mesh.verts.ensure_lookup_table()
        mesh.verts[0].co.z += 0.01 if number % 2 else -0.01
        bmesh.update_edit_mesh(made.data, destructive=False)

    return change


def headless(only: str | None) -> dict[str, Any]:
    """All figures without a window: of presets, and of the other changes."""
    import bpy

    scene = build_street()
    camera = bpy.data.objects.new("Live", bpy.data.cameras.new("Live"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_percentage = 100
    figures: dict[str, Any] = {"presets": {}, "changes": {}}
    for path in sorted((ROOT / "presets").glob("*.json")):
        if only in (None, path.stem):
            bench = prepared(scene, camera, path)
            row = figures["presets"][path.stem] = measured(bench, surface_drag(bench))
            print(line(path.stem, row, FIRST_GOAL), flush=True)
            if path.stem in CLOSELY:
                figures["changes"][path.stem] = closely(scene, bench)
            bench.live.painter.stop()
    return figures


def closely(scene, bench: Bench) -> dict[str, Row]:
    """The figures of other changes than a surface's."""
    import bpy

    rows = {}
    for name, made in (("slider", slider), ("playback", playback)):
        rows[name] = measured(bench, made(bench))
        print(line(name, rows[name], FIRST_GOAL), flush=True)
    bench.camera.scfpf.surfaces[-1].object.animation_data_clear()
    heavy = heavy_object(scene)
    bench.ask()
    bench.finished()
    for name, made in (("object", object_drag), ("mesh", mesh_edit)):
        rows[name] = measured(bench, made(heavy))
        print(line(name, rows[name], OBJECT_GOAL), flush=True)
    for name, edited, goal in (
        ("vertex of a mesh", heavy, OBJECT_GOAL),
        ("vertex of a surface", as_mesh(bench.camera), FIRST_GOAL),
    ):
        rows[name] = measured(bench, vertex_drag(edited))
        print(line(name, rows[name], goal), flush=True)
        bpy.ops.object.mode_set(mode="OBJECT")
        bench.ask()
        bench.finished()
    bpy.data.objects.remove(heavy)
    return rows


def line(name: str, row: Row, goal: float) -> str:
    """A line of figures; a figure that misses its goal is marked."""

    def marked(text: str, met: bool) -> str:
        return text if met else f"{text} MISSED"

    first = marked(f"{row['median'] * 1e3:4.0f} ms", row["median"] <= goal)
    rate = marked(f"{row['rate']:.0f} a second", row["rate"] >= 1.0 / goal)
    final = marked(f"{row['final']:.2f} s", row["final"] <= FINAL_GOAL)
    return (
        f"  {name:28s} first {first} (longest {row['longest'] * 1e3:.0f}, processor "
        f"{row['processor'] * 1e3:.0f}), {rate}, 1 : {row['coarseness']:g}, final {final}"
    )


def in_window(blender: str | None) -> dict[str, Row]:
    """The figures of drags by the mouse, by preset; empty, after a line that says so, without a window."""
    package.build(environments.first())
    more = {
        f"{SCENARIO}.py": ROOT / "benchmarks" / "live" / "window_drag.py",
        "demo": ROOT / "demo",
        "presets": ROOT / "presets",
    }
    deadline = time.monotonic() + LIMIT
    try:
        with window.place(blender, deadline) as found:
            results, warnings = window.run(found, [SCENARIO], deadline, more)
    except window.Unavailable as reason:
        print(f"NOT measured in a window: {reason}")
        return {}
    if warnings or not all(result.ended_well for result in results):
        sys.exit(" ".join(warnings) or "the drag in a window failed; see tests/window/shots")
    shutil.copy(window.SHOTS / RECORDING, ROOT / "docs" / "pictures")
    rows: dict[str, Row] = json.loads((window.SHOTS / FIGURES).read_text(encoding="utf-8"))
    for name, row in rows.items():
        print(
            f"  {name:20s} in a window: {row['median'] * 1e3:.0f} ms from the mouse to the image "
            f"(longest {row['longest'] * 1e3:.0f}), {row['rate']:.1f} a second, final {row['final']:.2f} s; "
            f"Solid view alone {row['solid'] * 1e3:.0f} ms"
        )
    return rows


def table(figures: dict[str, Any]) -> list[str]:
    """The lines of the document's table."""
    first = f"≤ {FIRST_GOAL * 1e3:.0f} ms"
    lines = [
        f"| preset | first image ({first}), longest | images a second (≥ {RATE_GOAL:.0f}) | viewport pixels "
        f"across one | final (≤ {FINAL_GOAL:g} s) |",
        "|---|---|---|---|---|",
    ]
    rows = dict(figures["presets"])
    for preset, changes in figures["changes"].items():
        rows.update({f"{preset}: {name}": row for name, row in changes.items()})
    lines += [
        f"| {name.replace('_', ' ')} | {row['median'] * 1e3:.0f} ms, {row['longest'] * 1e3:.0f} | "
        f"{row['rate']:.0f} | {row['coarseness']:g} | {row['final']:.2f} s |"
        for name, row in rows.items()
    ]
    if figures.get("window"):
        lines += [
            "",
            "By the mouse, in a window whose OpenGL is software:",
            "",
            "| preset | from the mouse to the image, longest | images a second | final | Solid view alone |",
            "|---|---|---|---|---|",
        ]
        lines += [
            f"| {name.replace('_', ' ')} | {row['median'] * 1e3:.0f} ms, {row['longest'] * 1e3:.0f} | "
            f"{row['rate']:.1f} | {row['final']:.2f} s | {row['solid'] * 1e3:.0f} ms |"
            for name, row in figures["window"].items()
        ]
    return lines


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", metavar="PRESET", help="one preset, by its file's name")
    parser.add_argument("--json", metavar="FILE", help="write all figures to this file")
    parser.add_argument("--markdown", metavar="FILE", help="put the table into this document")
    parser.add_argument("--headless", action="store_true", help="measure without a window alone")
    parser.add_argument("--blender-window", metavar="PATH", help="the Blender with a window to use")
    options = parser.parse_args(arguments)
    check_files(parser, written=options.json, document=options.markdown, sections=(SECTION,))
    with scratch_profile() as scratch:
        enable_add_on(scratch)
        print(f"Live View on the demo's street, {os.cpu_count()} cores, a frame {WIDTH} pixels wide")
        figures = headless(options.only)
    if not options.headless:
        figures["window"] = in_window(options.blender_window)
    if options.json:
        Path(options.json).write_text(json.dumps(figures, indent=1), encoding="utf-8")
    if options.markdown:
        replace_section(options.markdown, SECTION, table(figures))


if __name__ == "__main__":
    main(sys.argv[1:])
