# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as a render of layers needs it, read at once: views, and the things of layers.

From these follow the pixels of each layer, and whether positions need materials.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import bpy
import numpy as np

from ...bridge.blender import versions
from ...bridge.camera.ordinary_camera import is_own_frustum, is_own_view, placement
from ...bridge.layers.read_image_layers import ReadLayers, read_image_layers
from ...bridge.render.image_size import shown_aspect
from ...bridge.render.render_inputs import read_view, synced_image_size
from ...bridge.scene.instances import NO_THINGS, MeshTable, instances, is_finite
from ...bridge.scene.mesh_arrays import read_mesh
from ...bridge.scene.read_visibility import ShownInRenders, has_hair
from ...bridge.scene.render_depsgraph import with_render_depsgraph
from ...casting.common.parallel import chunks, parallel_map
from ...casting.common.ray_visibility import CAMERA
from ...casting.layers.layer_parts import DIRECTIONS, Box, Hull
from ...projection.mappings.stack import Stack
from ...projection.typing import Array, BoolArray
from ...projection.volume.reparameterisation import Framed
from ...projection.volume.viewing_volume import Projection
from ...shading.settings.frame_settings import Border
from ..hidden_surfaces import has_rendered
from ..rig_data import rigs
from ..seen_data import materials_of
from ..skipping.reasons import displaces, has_volume, links
from .joined_layers import shared, within
from .temporary_scene import TemporaryScene

# Pixels around a layer's own that its things may colour besides the filter's.
MARGIN = 1
# Nodes of shaders through which no camera ray passes, or that mix others.
OPAQUE = {
    "ADD_SHADER",
    "BSDF_DIFFUSE",
    "BSDF_GLASS",
    "BSDF_GLOSSY",
    "BSDF_METALLIC",
    "BSDF_PRINCIPLED",
    "BSDF_REFRACTION",
    "BSDF_SHEEN",
    "BSDF_TOON",
    "BSDF_TRANSLUCENT",
    "EMISSION",
    "GROUP",
    "GROUP_INPUT",
    "MIX_SHADER",
    "REROUTE",
    "SUBSURFACE_SCATTERING",
}


class LayerView(NamedTuple):
    """A view of an image with layers: that of the image itself, or of a layer.

    camera: its session id. frame: the place of its picture in the image. projection: what the image shows
    through it, world space. place: (4, 4), without scale, of a camera that Cycles renders without a rig: an
    ordinary one, or a flexible one whose volume is its own frustum. None for others. is_own: whether the
    projection is the view of the camera's own lens.
    """

    camera: int
    frame: Framed
    projection: Projection
    place: Array | None
    is_own: bool

    @property
    def own(self) -> Projection:
        """The projection of its own picture."""
        image = self.projection.reparameterisation
        if self.frame == Framed() or not isinstance(image, Stack):
            return self.projection
        return replace(self.projection, reparameterisation=image.base)


@dataclass
class Things:
    """The things of one layer.

    points: (3, N) blocks, world space, with the bounds of the things. is_open: whether Cycles may show them
    beyond these.
    """

    points: list[Array] = field(default_factory=list)
    is_open: bool = False

    @property
    def bounds(self) -> tuple[Box, Hull] | None:
        """The box and the hull around the points, None without any."""
        if not self.points:
            return None
        points = np.concatenate(self.points, axis=1)
        return Box.around(points), Hull.around(points)


@dataclass
class FoundThings:
    """The things that renders show, by layer.

    by_layer: the things of each layer that has some. boxes: around the objects of layer 0, by session id of
    the object or of its instancer.
    """

    by_layer: dict[int, Things] = field(default_factory=dict)
    boxes: dict[int, list[Array]] = field(default_factory=dict)


@dataclass(frozen=True)
class ReadViews:
    """An image with layers: numbers and arrays only.

    size: in pixels. views: of the image and of each layer, by number. layers: as read. things: of the layers.
    blurs: whether things may show beyond their places: by motion, or by a lens in any view. is_opaque: if no
    camera ray passes what it meets.
    """

    size: tuple[int, int]
    views: tuple[LayerView, ...]
    layers: ReadLayers
    things: FoundThings
    blurs: bool
    is_opaque: bool
    filter_width: float

    def bounds(self, number: int) -> tuple[Box, Hull] | None:
        """The bounds of a layer's things; None if renders show none of them."""
        things = self.things.by_layer.get(number)
        return None if things is None else things.bounds

    def box(self, number: int) -> Box:
        """The box around the things of a layer that has some."""
        found = self.bounds(number)
        assert found is not None
        return found[0]

    def window(self, number: int, region: Border) -> Border | None:
        """The rectangle in a region that may show a layer (from 1 on) or its halo; None if none may."""
        found = self.bounds(number)
        if found is None:
            return None
        layer, (box, hull) = self.layers.layers[number - 1], found
        if layer.halo > 0.0:
            hull = Hull.around(box.corners)
        is_open = self.blurs or self.things.by_layer[number].is_open
        width, height = self.size

        def seen(some: slice) -> BoolArray:
            which = np.arange(some.start, some.stop)
            x, y = (which % width + 0.5) / width, (which // width + 0.5) / height
            met = layer.shown_at(x, y)
            image = layer.projection.reparameterisation
            met &= image.points(x, y, layer.projection.aspect).mask
            if not is_open and met.any():
                met[met] = hull.may_be_met(layer.projection, x[met], y[met], layer.halo)
            return met

        met = np.concatenate(parallel_map(seen, chunks(width * height))).reshape(height, width)
        window = within(met, Border(0, 0, width, height))
        if window is None:
            return None
        more = MARGIN + int(np.ceil(self.filter_width / 2))
        wider = Border(window.left - more, window.bottom - more, window.right + more, window.top + more)
        return shared(wider, region)

    def beyond(self, number: int) -> frozenset[int]:
        """Session ids of the objects of layer 0 that are outside of a layer's halo."""
        found, halo = self.bounds(number), self.layers.layers[number - 1].halo
        if found is None:
            return frozenset()
        box = found[0]
        return frozenset(uid for uid, blocks in self.things.boxes.items() if _gap(box, blocks) > halo)


def _gap(box: Box, blocks: list[Array]) -> float:
    """The least distance between a box and the boxes around blocks of points (3, N)."""
    gaps = []
    for points in blocks:
        other = Box.around(points)
        apart = np.maximum(0.0, np.maximum(other.lower - box.upper, box.lower - other.upper))
        gaps.append(float(np.linalg.norm(apart)))
    return min(gaps)


def read_views(passing: TemporaryScene, camera) -> ReadViews:
    """Read an image of the passing scene through a camera with layers. Raises USER_ERRORS."""
    scene = passing.scene
    size = synced_image_size(scene, camera)
    return with_render_depsgraph(
        scene, scene.view_layers[0], lambda depsgraph: _read(depsgraph, camera, size)
    )


def _own_place(camera, depsgraph, seen: Projection) -> Array | None:
    """The place of a flexible camera whose picture F12 makes without a rig; None for others.

    seen: its projection. A rig of its own, the shutter, the lens, and control surfaces that other renders
    show keep it flexible.
    """
    scene, evaluated = depsgraph.scene_eval, camera.evaluated_get(depsgraph)
    is_plain = not (scene.render.use_motion_blur or camera.data.dof.use_dof)
    if not is_plain or has_rendered(depsgraph.scene) or any(rig.scfpf_rig.camera == camera for rig in rigs()):
        return None
    return placement(evaluated) if is_own_frustum(seen, evaluated, depsgraph) else None


def _read(depsgraph, camera, size: tuple[int, int]) -> ReadViews:
    scene = depsgraph.scene_eval
    aspect = shown_aspect(scene.render, *size)
    layers = read_image_layers(camera, depsgraph, aspect)
    lenses, seen = [camera.data.dof.use_dof], read_view(depsgraph, camera, aspect)
    is_own = is_own_view(seen, camera.evaluated_get(depsgraph), depsgraph)
    views = [LayerView(camera.session_uid, Framed(), seen, _own_place(camera, depsgraph, seen), is_own)]
    own = {each.camera.session_uid: each.camera for each in camera.scfpf.layers if each.camera is not None}
    own_views = (plane is not None for plane in layers.planes)
    read = zip(layers.layers, layers.cameras, layers.frames, own_views, strict=True)
    for layer, uid, frame, is_own in read:
        eye = own[uid].evaluated_get(depsgraph)
        place = None if eye.scfpf.enabled else placement(eye)
        views.append(LayerView(uid, frame, layer.projection, place, is_own))
        lenses.append(eye.data.dof.use_dof)
    halos = any(layer.halo > 0.0 for layer in layers.layers)
    return ReadViews(
        size=size,
        views=tuple(views),
        layers=layers,
        things=find_things(depsgraph, layers.members, halos),
        blurs=scene.render.use_motion_blur or any(lenses),
        is_opaque=is_all_opaque(depsgraph),
        filter_width=scene.cycles.filter_width,
    )


def find_things(depsgraph, members: Mapping[int, int], with_rest: bool) -> FoundThings:
    """Find the things of layers from 1 on. members: see ``ReadLayers``. with_rest: boxes of layer 0."""
    found, scene = FoundThings(), depsgraph.scene_eval
    meshes = MeshTable(_used_points)
    # By address of the data.
    corners: dict[int, Array] = {}
    for instance in instances(depsgraph, renders=ShownInRenders(depsgraph)):
        obj, owner = instance.obj, instance.key.owner_uid
        if obj.type in NO_THINGS or not instance.rays & CAMERA:
            continue
        # Cycles shows an instance in the layer of what makes it, whatever layer the object is in.
        number = members.get(owner, 0)
        if not number and not with_rest:
            continue
        matrix = instance.matrix
        if not is_finite(matrix):
            continue
        if number and obj.type == "MESH":
            points = meshes.of(instance)
        else:
            address = instance.data
            if address not in corners:
                corners[address] = np.array(obj.bound_box, np.float64).T
            points = corners[address]
        if not points.shape[1]:
            continue
        placed = matrix[:3, :3] @ points + matrix[:3, 3:]
        if number:
            things = found.by_layer.setdefault(number, Things())
            things.points.append(_extremes(placed))
            things.is_open = things.is_open or _is_open(obj, scene)
        else:
            found.boxes.setdefault(owner, []).append(placed)
    return found


def _used_points(mesh) -> Array:
    """The vertices (3, N) of an evaluated mesh's triangles."""
    arrays = read_mesh(mesh)
    points: Array = arrays.vertices[np.unique(arrays.triangles)].astype(np.float64).T
    return points


def _extremes(points: Array) -> Array:
    """The points, of (3, N), N > 0, that reach farthest in one of DIRECTIONS."""
    heights = [direction @ points for direction in DIRECTIONS]
    ends = {int(end) for each in heights for end in (each.argmin(), each.argmax())}
    return points[:, sorted(ends)]


def _is_open(obj, scene) -> bool:
    """Return whether Cycles may show an object beyond its mesh: hair, points, volumes, displacement."""
    if obj.type != "MESH" or has_hair(obj):
        return True
    subdivided = (each for each in obj.modifiers if each.type == "SUBSURF" and each.show_render)
    if any(versions.is_subdivided_adaptively(each, obj, scene) for each in subdivided):
        return True
    return any(displaces(material) for material in materials_of(obj))


def is_all_opaque(depsgraph) -> bool:
    """Return whether every material of an evaluated scene is opaque, and none moves or fills surfaces."""
    scene = depsgraph.scene_eval
    if scene.cycles.film_transparent_glass or has_volume(scene.world):
        return False
    known: dict[int, bool] = {}
    return not any(_lets_through(each, known) for each in depsgraph.ids)


def _lets_through(datablock, known: dict[int, bool]) -> bool:
    """Return whether camera rays may pass a material or an object. known: of trees, by address."""
    if isinstance(datablock, bpy.types.Object):
        # Lights count as catchers of shadows, too.
        return datablock.type == "VOLUME" or (datablock.is_shadow_catcher and datablock.type not in NO_THINGS)
    if not isinstance(datablock, bpy.types.Material) or datablock.node_tree is None:
        return False
    return (
        displaces(datablock)
        or links(datablock, "OUTPUT_MATERIAL", "Volume")
        or not links(datablock, "OUTPUT_MATERIAL", "Surface")
        or not _is_opaque(datablock.node_tree, known)
    )


def _is_opaque(tree, known: dict[int, bool]) -> bool:
    """Return whether no shader of a tree, or of a group in it, lets rays through. known: the answers."""
    # Evaluated trees have no session ids.
    key = tree.as_pointer()
    if key not in known:
        shaders = [node for node in tree.nodes if any(out.type == "SHADER" for out in node.outputs)]
        known[key] = all(node.type in OPAQUE and _is_solid(node) for node in shaders) and all(
            node.node_tree is None or _is_opaque(node.node_tree, known)
            for node in shaders
            if node.type == "GROUP"
        )
    return known[key]


def _is_solid(node) -> bool:
    """Return whether the alpha of a node is always 1."""
    alpha = node.inputs.get("Alpha") if node.type == "BSDF_PRINCIPLED" else None
    return alpha is None or (not alpha.is_linked and alpha.default_value == 1.0)
