# SPDX-License-Identifier: GPL-3.0-or-later
"""The measurements of ``scale`` in Blender: large images by the Render button, files of many cameras."""

from __future__ import annotations

import importlib
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter, thread_time
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.scenes import SCENES
from demo.render_demo import MODULE
from scfpf_addon.casting.common.memory import peak_memory

FEW_TRIANGLES = 20_000
THREADS = 2
REPEATS = 30


class AnyLayout:
    """Stands for a UILayout, which Blender gives to nobody without a window: takes whatever is drawn."""

    def __getattr__(self, name: str) -> Any:
        if name == "panel":
            return lambda *_, **_options: (AnyLayout(), AnyLayout())
        return lambda *_, **_options: AnyLayout()


class PanelPart:
    """The Python side of a panel."""

    def __init__(self, cls: type) -> None:
        self.cls, self.layout = cls, AnyLayout()

    def __getattr__(self, name: str) -> Any:
        found = getattr(self.cls, name)
        return found.__get__(self) if callable(found) else found


def part(name: str) -> Any:
    """A module of the add-on as Blender has it."""
    return importlib.import_module(f"{MODULE}.{name}")


def our_panels() -> list[type]:
    """All sections of our panel in the sidebar."""
    return [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("SCFPF_PT_view")]


def draw_panels(panels: list[type]) -> None:
    """Draw the panel as Python does, with each row of the list of surfaces."""
    context, layout = bpy.context, AnyLayout()
    for cls in panels:
        if cls.poll(context):
            PanelPart(cls).draw(context)
    settings, rows = context.scene.camera.scfpf, bpy.types.SCFPF_UL_surfaces
    for index, slot in enumerate(settings.surfaces):
        rows.draw_item(None, context, layout, settings, slot, 0, settings, "active_surface", index)


def blender_image(width: int, height: int) -> dict[str, Any]:
    """The same by the operator of the Render button, into Blender's image, packed if a file can hold it."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    mesh = bpy.data.meshes.new("Boxes")
    vertices, faces = SCENES["boxes"](FEW_TRIANGLES)
    mesh.from_pydata(vertices, [], faces)
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("Boxes", mesh))
    camera = many_cameras(1, 3, 1.0)[0]
    camera.scfpf.samples = 1
    # Into the midst of the boxes.
    camera.scale = 6.0, 6.0, 6.0
    scene.camera, render = camera, scene.render
    render.resolution_percentage, render.threads_mode, render.threads = 100, "FIXED", THREADS
    render.resolution_x = render.resolution_y = 512
    bpy.ops.scfpf.render()
    before = peak_memory()
    render.resolution_x, render.resolution_y = width, height
    started = perf_counter()
    bpy.ops.scfpf.render()
    seconds = perf_counter() - started
    image = bpy.data.images["SCFPF Render"]
    assert tuple(image.size) == (width, height)
    assert "chords a projector" in camera.scfpf.statistics, camera.scfpf.statistics
    packed = image.packed_file.size if image.packed_file else 0
    return {"seconds": seconds, "before": before, "memory": peak_memory(), "packed": packed}


def file_of(cameras: int, each: int) -> dict[str, Any]:
    """Times of an edit, the panel, undo and opening with many cameras: milliseconds of the thread."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    made = many_cameras(cameras, each, 1.0)
    mesh = bpy.data.meshes.new("Cube")
    cube = bpy.data.objects.new("Cube", mesh)
    bpy.context.scene.collection.objects.link(cube)
    bpy.context.view_layer.update()
    surface = made[-1].scfpf.surfaces[0].object

    def move(thing: Any, number: int) -> None:
        thing.location.x = 0.01 * number

    edits: dict[str, Callable[[int], None]] = {
        "unrelated": lambda number: move(cube, number),
        "surface": lambda number: move(surface, number),
        "selection": lambda number: cube.select_set(number % 2 == 0),
    }
    result: dict[str, Any] = {}
    handlers = bpy.app.handlers.depsgraph_update_post
    for name, edit in edits.items():
        ours, found = list(handlers), {}
        for kind in ("with", "without"):
            handlers[:] = ours if kind == "with" else []
            found[kind] = min(_costs(lambda n, e=edit: (e(n), bpy.context.view_layer.update())))
        handlers[:] = ours
        result[name], result[f"{name}, Blender alone"] = found["with"], found["without"]
    result["structure"] = median(_costs(_linked(), 5))
    bpy.context.view_layer.objects.active = made[-1]
    bpy.context.scene.camera = made[-1]
    panels = our_panels()
    result["panel"] = median(_costs(lambda _: draw_panels(panels)))
    result["lines read"] = median(_costs(_drawing(surface), 10))
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, "many.blend"))
        bpy.ops.wm.save_as_mainfile(filepath=path)
        result["opening"] = median(_costs(lambda _: bpy.ops.wm.open_mainfile(filepath=path), 5))
        result["undo"] = median(_undo_costs(5))
    return result


def _costs(work: Callable[[int], Any], repeats: int = REPEATS) -> list[float]:
    """Milliseconds of this thread that each of several runs takes, but for the first."""
    found = []
    for number in range(repeats + 1):
        started = thread_time()
        work(number)
        found.append(1e3 * (thread_time() - started))
    return found[1:]


def _linked() -> Callable[[int], None]:
    """Adds an object: Blender builds all relations anew."""

    def add(number: int) -> None:
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(f"Empty {number}", None))
        bpy.context.view_layer.update()

    return add


def _drawing(surface: Any) -> Callable[[int], None]:
    """The time of the lines of all volumes when one surface has moved: volumes read, not the GPU's part."""
    drawing = part("scfpf_addon.bridge.overlays.viewport_overlay")

    drawing.diagram = lambda *_: {}
    drawing.gpu.shader.from_builtin = lambda _name: None

    def draw(number: int) -> None:
        surface.location.x = 0.01 * number
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for camera in drawing.drawings.cameras(bpy.context.scene, bpy.context.view_layer):
            drawing.drawings.drawing(camera, depsgraph, 1.5)

    return draw


def _undo_costs(repeats: int) -> list[float]:
    found = []
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        for number in range(repeats):
            bpy.ops.ed.undo_push(message="before")
            bpy.data.objects["Cube"].location.y = 1.0 + number
            bpy.ops.ed.undo_push(message="moved")
            started = thread_time()
            bpy.ops.ed.undo()
            bpy.context.view_layer.update()
            found.append(1e3 * (thread_time() - started))
    return found


def many_cameras(cameras: int, each: int, step: float) -> list[Any]:
    """Flexible cameras side by side, with so many planes each."""
    flexible_camera = part("scfpf_addon.bridge.camera.flexible_camera")
    made = []
    for number in range(cameras):
        camera = bpy.data.objects.new(f"Eye {number}", bpy.data.cameras.new(f"Eye {number}"))
        camera.location.x = 3.0 * number
        bpy.context.scene.collection.objects.link(camera)
        described = []
        for place in range(each):
            matrix = np.eye(4)
            matrix[2, 3] = -step * (place + 1)
            described.append(
                flexible_camera.NewSurface(
                    f"Surface {place}", "PLANE", matrix, {"width": 1.0 + place, "height": 1.0}
                )
            )
        flexible_camera.replace_surfaces(camera, described)
        flexible_camera.make_flexible(camera)
        made.append(camera)
    return made
