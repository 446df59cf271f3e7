# SPDX-License-Identifier: GPL-3.0-or-later
"""Waves of many materials: the light of each by itself, and work that does not grow with their number."""

import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from scfpf_addon.casting.common.geometry import Layer
from scfpf_addon.casting.scene.traced_mesh import TracedMesh
from scfpf_addon.shading import frame
from scfpf_addon.shading.frame import render_frame, render_tile
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.nodes.graph_kinds import graph_kinds
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import FrameSettings

# Squares beside each other, a pixel each, which do not see one another.
SIDE = 15
SETTINGS = FrameSettings(SIDE, SIDE, samples=2, threads=1)


class Made:
    """A graph that is put together."""

    def __init__(self):
        self.operations, self.closures = [Operation("NORMAL")], []

    def constant(self, value):
        """A constant of its own, or the one of that value before: as chance has it."""
        value = np.atleast_1d(np.asarray(value, float))
        for number, each in enumerate(self.operations):
            if each.kind == "CONSTANT" and np.array_equal(each.settings["value"], value):
                return Ref(number)
        return self.operation("CONSTANT", value=value)

    def operation(self, kind, *inputs, **settings):
        self.operations.append(Operation(kind, inputs, settings))
        return Ref(len(self.operations) - 1)

    def closure(self, kind, weight=1.0, **inputs):
        refs = {name: each if isinstance(each, Ref) else self.constant(each) for name, each in inputs.items()}
        weight = weight if isinstance(weight, Ref) else self.constant(weight)
        self.closures.append(Closure(kind, weight, {"normal": Ref(0), **refs}))

    def principled(self, weight=1.0, **inputs):
        usual = {"base_color": np.full(3, 0.8), "metallic": 0.0, "roughness": 0.5, "ior": 1.5, "alpha": 1.0}
        usual |= {"specular_level": 0.5, "transmission": 0.0, "emission": np.zeros(3), "multiscatter": 1.0}
        self.closure("PRINCIPLED", weight, **usual | inputs)

    def graph(self):
        return MaterialGraph(tuple(self.operations), tuple(self.closures))


def glass(made, color, share):
    made.closure("GLASS", color=color, roughness=0.0, ior=1.2 + share)


def metal(made, color, share):
    made.principled(base_color=color, metallic=1.0, roughness=0.9 * share)


def layered(made, color, share):
    made.principled(base_color=color, roughness=0.5 * share, alpha=0.5 + 0.5 * share)


def mixed(made, color, share):
    made.closure("GLOSSY", share, color=color, roughness=0.1, multiscatter=0.0)
    made.closure("DIFFUSE", 1.0 - share, color=color)
    made.closure("EMISSION", color=0.1 * color)


def painted(made, color, share):
    layer = made.operation("LAYER", name="paint", channels=1)
    tint = made.operation("VECTOR_MATH", layer, made.constant(color), layer, layer, operation="MULTIPLY")
    made.principled(base_color=tint, roughness=0.3 + 0.6 * share)


KINDS = (None, glass, metal, layered, mixed, painted)


def scene_of(build, count):
    """Squares of ``count`` materials in turn, lit by a lamp and a uniform world."""
    places = [(x + 0.5, y + 0.5) for y in range(SIDE) for x in range(SIDE)]
    scene = build.scene([build.square(0.5, 0.0, place) for place in places], world=(0.3, 0.4, 0.6))
    generator, graphs = np.random.default_rng(5), {}
    for number in range(count):
        color, share = generator.uniform(0.1, 0.9, 3), generator.uniform()
        kind = KINDS[number % len(KINDS)]
        if kind:
            made = Made()
            kind(made, color, share)
            graphs[number] = made.graph()
    number = (np.arange(len(scene.geometry.triangles)) // 2 % count).astype(np.int32)
    values = np.tile([0.2, 0.9, 0.5], (len(number), 1))[..., None].astype(np.float32)
    layer = Layer(np.arange(len(number), dtype=np.int32), values)
    materials = replace(build.materials(count, base=(0.7, 0.5, 0.2), f0=0.04), graphs=graphs)
    lamp = Light("POINT", np.full(3, 900.0), build.placed((SIDE / 2, SIDE / 2, 6.0)))
    geometry = replace(scene.geometry, material=number, layers={"paint": layer})
    return replace(scene, geometry=geometry, materials=materials, lights=(lamp,))


def looking_down(build):
    """An image that has a square in each pixel."""
    projection = build.looking_down(3.0, -1.0, size=float(SIDE))
    matrix = np.eye(4)
    matrix[:2, 3] = SIDE / 2
    return projection.transformed(matrix)


def test_each_material_has_the_light_that_it_has_alone(build):
    scene, projection = scene_of(build, 18), looking_down(build)
    pixels = render_frame(projection, scene, SETTINGS).pixels
    assert len(np.unique(pixels[..., 0])) > 18
    shown = np.arange(SIDE * SIDE).reshape(SIDE, SIDE) % 18
    for number in range(18):
        alone = replace(scene.geometry, material=np.full_like(scene.geometry.material, number))
        expected = render_frame(projection, replace(scene, geometry=alone), SETTINGS).pixels
        own = shown == number
        np.testing.assert_allclose(pixels[own], expected[own], rtol=2e-6, atol=1e-6)


def counting(counts, name, function):
    """The function, whose calls are counted."""

    def counted(*args):
        counts[name] += 1
        return function(*args)

    return counted


def work(monkeypatch, projection, scene):
    """The casts and the calls of NumPy's functions and arrays in the tiles of a frame."""
    counts = Counter()
    for name in ("trace", "occluded"):
        cast = getattr(TracedMesh, name)
        monkeypatch.setattr(TracedMesh, name, counting(counts, name, cast))

    def called(_, event, function):
        if event == "c_call":
            owner = getattr(function, "__self__", None)
            numpy = (getattr(function, "__module__", None) or "").startswith("numpy")
            counts["numpy"] += numpy or isinstance(owner, np.ndarray | np.ufunc)

    def profiled(*args):
        sys.setprofile(called)
        try:
            return render_tile(*args)
        finally:
            sys.setprofile(None)

    monkeypatch.setattr(frame, "render_tile", profiled)
    render_frame(projection, scene, SETTINGS)
    monkeypatch.undo()
    return counts


def test_the_work_of_a_wave_depends_on_kinds_of_graphs_not_on_materials(build, monkeypatch):
    projection = looking_down(build)
    few, many = (scene_of(build, count) for count in (6, 216))
    assert len(graph_kinds(few.materials.graphs)) == len(graph_kinds(many.materials.graphs)) == 4
    for scene in (few, many):
        # Tables of roughness are made at first use.
        render_frame(projection, scene, SETTINGS)
    less, more = (work(monkeypatch, projection, scene) for scene in (few, many))
    assert less["trace"] and less["trace"] == more["trace"] and less["occluded"] == more["occluded"]
    assert less["numpy"] > 1000 and more["numpy"] < 1.05 * less["numpy"], (less, more)
