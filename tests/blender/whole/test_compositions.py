# SPDX-License-Identifier: GPL-3.0-or-later
"""The compositions of docs/compositions.md: what the page says holds, and almost nothing is mirrored."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from engine_images import f12, write_multilayer

from demo.compositions import graph_street, joiner, make, squares
from demo.compositions.parts import sized
from demo.recipes import layer_pictures

pytestmark = pytest.mark.usefixtures("kept_street")

# Of the images of these tests, and the most of their pixels that may be mirrored.
WIDTH, MIRRORED = 96, 0.002


class Image:
    """A composition's scene and its hits, pixel by pixel, row 0 at the bottom."""

    def __init__(self, addon, name, scene=None):
        self.scene = scene or make.build(name)
        depsgraph, render = bpy.context.evaluated_depsgraph_get(), self.scene.render
        self.aspect = render.resolution_x / render.resolution_y
        self.read = addon("bridge.camera.read_projection").read_projection
        self.projection = self.read(self.scene.camera, depsgraph, self.aspect)
        self.geometry = addon("bridge.scene.read_scene").read_scene(depsgraph).geometry
        self.cast_scene = addon("casting.scene.cast_scene").CastScene(
            self.geometry.vertices, self.geometry.triangles
        )
        self.cast = addon("casting.frame").cast_frame
        self.high = round(WIDTH / self.aspect)
        self.x, self.y = (
            each.ravel() for each in np.meshgrid((np.arange(WIDTH) + 0.5) / WIDTH, self.rows(self.high))
        )

    @staticmethod
    def rows(count):
        return (np.arange(count) + 0.5) / count

    def points(self, x, y, t):
        places = self.projection.parameters(x, y)
        return self.projection.volume.evaluate(places.u, places.v, t).position

    def hits(self, projection=None):
        """t, the names of the objects hit, "" for none, and the points (3, N)."""
        found = self.cast(self.cast_scene, projection or self.projection, WIDTH, self.high, 0.25)
        hit = found.triangle >= 0
        names = np.array([*self.geometry.object_names, ""])
        number = np.where(hit, self.geometry.object_index[found.triangle], len(names) - 1)
        return found.t, names[number], self.points(self.x, self.y, found.t)

    def mirrored(self):
        """The share of hits whose image is turned over, by differences of positions."""
        t, names, _ = self.hits()
        step = 1e-5
        across, up, ahead = (
            self.points(self.x + a, self.y + b, t + c) - self.points(self.x - a, self.y - b, t - c)
            for a, b, c in np.eye(3) * step
        )
        side = np.einsum("cn,cn->n", np.cross(across, up, axis=0), ahead)[names != ""]
        return float((side * np.sign(np.median(side)) < 0).mean())


def chain(camera):
    """The cameras of nested blends, from the last one to the ordinary view that they began with."""
    found = [camera]
    while found[-1].scfpf.blend_ends.first:
        found.append(found[-1].scfpf.blend_ends.first)
    return found


def test_the_monument_is_where_it_would_be_without_the_palace(addon):
    image = Image(addon, "behind")
    _, names, _ = image.hits()
    first = chain(image.scene.camera)[1]
    assert first.name == "Eye Level"
    place = squares.seen_at(image.scene, first, squares.MONUMENT)
    near = np.hypot(image.x - place[0], (image.y - place[1]) / image.aspect).argmin()
    projection = image.read(first, bpy.context.evaluated_depsgraph_get(), image.aspect)
    assert names[near] == "Monument" and image.hits(projection)[1][near].startswith("Houses")
    assert image.mirrored() <= MIRRORED


@pytest.mark.parametrize(("name", "count"), [("tour", 3), ("room", 3)])
def test_nested_blends(addon, name, count):
    image = Image(addon, name)
    blends = chain(image.scene.camera)[:-1]
    assert len(blends) == count and all(each.scfpf.blend_field.kind != "NONE" for each in blends)
    assert image.mirrored() <= MIRRORED


def test_one_sees_down_all_side_streets(addon):
    image = Image(addon, "graph-street")
    _, _, points = image.hits()
    for low, high, number in graph_street.edges():
        if number:
            inside = (image.x > low) & (image.x < high)
            far = points[0, inside] * np.sign(number)
            begin, end = graph_street.SIDES[abs(number) - 1]
            there = (far > 24.0) & (points[1, inside] > begin - 1) & (points[1, inside] < end + 1)
            assert there.mean() > 0.04, number
    assert image.mirrored() <= MIRRORED


def test_every_print_is_a_linear_camera_of_its_own(addon):
    """Each print's projectors meet in one point, and the points differ."""
    image = Image(addon, "joiner")
    near, far = (surface for surface in image.projection.volume.surfaces)
    count = joiner.ROWS * joiner.COLUMNS
    assert near.chart.islands.max() + 1 == 2 * count + 1
    eyes = []
    for k in range(0, 2 * count, 2):
        own = np.unique(near.chart.vertices[near.chart.islands == k])
        start, way = near.points[own].T, (far.points[own] - near.points[own]).T
        way = way / np.linalg.norm(way, axis=0)
        across = np.eye(3)[None] - np.einsum("cn,dn->ncd", way, way)
        eye = np.linalg.solve(across.sum(axis=0), np.einsum("ncd,dn->c", across, start))
        off = np.einsum("ncd,dn->cn", across, eye[:, None] - start)
        assert np.abs(off).max() < 1e-3
        eyes.append(eye)
    assert len({tuple(np.round(eye, 2)) for eye in eyes}) == count


def test_the_background_of_the_car_is_identical_and_next_to_nothing_is_mirrored(addon, tmp_path):
    """Hidden by a black mask, the layer leaves every pixel as it is that does not show the car."""
    image = Image(addon, "car", layer_pictures.both_sides())
    scene = sized(image.scene, WIDTH, image.high)
    write_multilayer(scene, tmp_path / "car")
    layer = scene.camera.scfpf.layers[0]
    layer.halo, scene.camera.scfpf.samples = 0.0, 1
    scene.render.filter_size, bpy.context.view_layer.use_pass_object_index = 0.0, True
    for obj in bpy.data.collections["Car"].all_objects:
        obj.pass_index = 7
    shown = f12(scene)
    layer.mask = bpy.data.images.new("Black", 1, 1)
    hidden = f12(scene)["ViewLayer.Combined"]
    index = shown["ViewLayer.Object Index" if bpy.app.version >= (5, 0, 0) else "ViewLayer.IndexOB"][..., 0]
    off = (shown["ViewLayer.Combined"] != hidden).any(axis=2)
    assert 0.1 < (index == 7).mean() < 0.5 and not off[index != 7].any() and off[index == 7].mean() > 0.9
    # The car alone, by the volume of its layer.
    layer.mask, depsgraph = None, bpy.context.evaluated_depsgraph_get()
    read = addon("bridge.layers.read_image_layers").read_image_layers(scene.camera, depsgraph, image.aspect)
    image.projection = read.layers[0].projection
    car = bpy.data.collections["Car"].all_objects
    own = [number for number, name in enumerate(image.geometry.object_names) if name in car]
    chosen = image.geometry.triangles[np.isin(image.geometry.object_index, own)]
    image.geometry = replace(image.geometry, triangles=chosen, object_index=np.zeros(len(chosen), np.int32))
    image.cast_scene = addon("casting.scene.cast_scene").CastScene(image.geometry.vertices, chosen)
    assert image.mirrored() <= MIRRORED


def test_pictures_and_files_are_made(empty_file, tmp_path, monkeypatch):
    monkeypatch.setattr(make, "OUTPUT", tmp_path / "files")
    make.make("room", tmp_path / "pictures", 4, 1)
    assert (tmp_path / "pictures" / "room.jpg").stat().st_size > 500
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "files" / "room.blend"))
    assert bpy.context.scene.camera.name == "Room" and bpy.context.scene.render.engine == "SCFPF"
    assert bpy.context.scene.camera.scfpf.blend_ends.second.name == "Table"
