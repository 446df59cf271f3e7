# SPDX-License-Identifier: GPL-3.0-or-later
"""Depsgraph → ``Scene``: triangles, normals, materials and lights as arrays in world space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry
from ...casting.common.memory import shortage
from ...casting.common.ray_visibility import CAMERA, EVERYWHERE
from ...projection.typing import Array
from ...shading.scene.shading_scene import Light, Scene
from ..camera.flexible_camera import control_objects
from .light_paths import read_bounces, unshown_settings
from .mesh_arrays import LARGEST_COORDINATE, MeshArrays, of_mesh, own_normals, read_mesh
from .read_layers import join_layers, read_layer
from .read_lights import read_light, read_tint
from .read_materials import MaterialTable, listing
from .read_visibility import LightLinks, visible_rays
from .read_world import darkness, read_world, world_seen
from .transforms import normal_transforms, normalize, turn

# Corner normals have nine numbers a triangle; beyond this their flat index leaves int32.
MAXIMUM_TRIANGLES = (2**31 - 1) // 9

# What a triangle takes as arrays, in cast space and in Embree: measured, flat shading.
BYTES_PER_TRIANGLE = 200

# What has no faces to show but is seen in Blender's own renders.
FACELESS = {"CURVES", "POINTCLOUD", "VOLUME", "GREASEPENCIL"}

# What a view layer may leave out of that and of all else: its switches by kind of object.
FILTERS = {
    "MESH": "use_solid",
    "CURVES": "use_strand",
    "VOLUME": "use_volumes",
    "GREASEPENCIL": "use_grease_pencil",
}

NO_SURFACES = (
    "The view layer leaves out all surfaces: switch Surfaces on in View Layer Properties, Filter and Override"
)
VERTEX_GROUPS = "Vertex groups are 0 in materials unless they are stored as attributes: "
NOTHING = "There is nothing to render: add an object with faces that is visible in renders"


class SceneError(ValueError):
    """The scene cannot be read; the message says what to do."""


@dataclass(frozen=True)
class Instances:
    """The transforms of the meshes.

    mesh: (N,) number of each instance's mesh. look: (N,) number of its look.
    matrix: (N, 4, 4) float64. look_object: (L,) object number of each look.
    slots: material number of each look's slots, look after look; first_slot: (L + 1,) where each
    look's begin. visibility, linked: (N,), see ``Geometry``.
    """

    mesh: NDArray[np.int32]
    look: NDArray[np.int32]
    matrix: Array
    look_object: NDArray[np.int32]
    slots: NDArray[np.int32]
    first_slot: NDArray[np.int32]
    visibility: NDArray[np.uint8] | None = None
    linked: NDArray[np.int32] | None = None


def never() -> bool:
    """Cancel nothing."""
    return False


def read_scene(
    depsgraph, may_be_empty: bool = False, with_uv: bool = False, cancelled: Callable[[], bool] = never
) -> Scene:
    """Everything that a picture of the depsgraph's view layer shows.

    Objects come as F12 shows them if the depsgraph is a render one
    (``render_depsgraph``); a viewport one lacks what is hidden in the viewport and
    has the viewport's subdivision levels. Left out in both: what is hidden in
    renders, excluded collections, what no ray is to meet, control surfaces.
    A hidden object is shown where it is instanced by nodes or on vertices, as by F12.
    may_be_empty: a scene without anything to show is one of no triangles, with a warning.
    with_uv: read the texture coordinates that renders use, too. stopped(): whether the picture
    is given up; what was read by then comes back.
    Raises SceneError if nothing is left otherwise, or memory cannot hold it.
    """
    reader = _SceneReader(depsgraph, with_uv)
    for instance in depsgraph.object_instances:
        if cancelled():
            break
        reader.add(instance)
    reader.complete()
    geometry = join(reader.meshes, reader.instances(), tuple(reader.object_numbers), with_uv)
    visibility = geometry.visibility
    shown = len(geometry.triangles) > 0 if visibility is None else bool((visibility & CAMERA).any())
    wanted = depsgraph.view_layer_eval.use_solid
    if not shown and not may_be_empty:
        raise SceneError(NOTHING if wanted else NO_SURFACES)
    world_color, world, world_warnings = read_world(depsgraph.scene_eval, depsgraph.view_layer_eval)
    if not (np.abs(world_color) <= LARGEST_COORDINATE).all():
        world_color = np.zeros(3)
        world_warnings = (
            *world_warnings,
            "The world's light is left out, as it is not finite: check the world's nodes",
        )
    made = Scene(
        geometry,
        reader.materials.materials(),
        reader.links.linked(reader.lights),
        world_color,
        warnings=(() if shown or not wanted else (NOTHING,))
        + reader.warnings()
        + reader.materials.warnings()
        + world_warnings
        + unshown_settings(depsgraph.scene_eval),
        object_index=tuple(reader.pass_indices),
        material_index=tuple(reader.materials.pass_indices),
        material_names=tuple(reader.materials.names),
        bounces=read_bounces(depsgraph.scene_eval),
        world=world,
        world_seen=world_seen(depsgraph.scene_eval, depsgraph.view_layer_eval),
    )
    return replace(made, warnings=made.warnings + darkness(made))


class _SceneReader:
    """Gathers instances; every mesh, material and visibility is looked at once."""

    def __init__(self, depsgraph, with_uv: bool) -> None:
        self.meshes: list[MeshArrays] = []
        self.object_numbers: dict[str, int] = {}
        self.pass_indices: list[int] = []
        self.lights: list[Light] = []
        self.materials = MaterialTable()
        self._with_uv = with_uv
        self._view_layer = depsgraph.view_layer
        evaluated = depsgraph.view_layer_eval
        self._filtered = {kind for kind, name in FILTERS.items() if not getattr(evaluated, name)}
        self._material = evaluated.material_override
        self._left_out = control_objects()
        self._rendered = None if depsgraph.mode == "RENDER" else _rendered_objects(depsgraph.view_layer)
        self.links = LightLinks()
        # What rays meet each object, and the number by which lamps know it.
        self._shown: dict[tuple[int, int], tuple[int, int]] = {}
        self._seen: list[tuple[int, int]] = []
        self._mesh_numbers: dict[int, int] = {}
        self._look_numbers: dict[tuple[int, int], int] = {}
        self._looks: list[tuple[int, list[int]]] = []
        self._placed: list[tuple[int, int]] = []
        self._matrices: list[Array] = []
        self._bad_place: dict[str, None] = {}
        self._bad_shape: dict[str, None] = {}
        self._faceless: dict[str, None] = {}
        self._vertex_groups: dict[str, None] = {}
        # By lamp: what its nodes make of its light, with notes; and those lamps' names by note.
        self._tints: dict[int, tuple[Array, tuple[str, ...]]] = {}
        self._uneven: dict[str, dict[str, None]] = {}

    def add(self, instance) -> None:
        """Take one entry of ``object_instances``; nothing of it is kept."""
        thing = instance.object
        if thing.type not in {"MESH", "LIGHT"} and thing.type not in FACELESS:
            return
        if thing.type in self._filtered:
            return
        own, parent = thing.original, instance.parent
        pointer = own.as_pointer()
        key = (pointer, parent.original.as_pointer() if parent else 0)
        shown = self._shown.get(key)
        if shown is None:
            name, above = own.name_full, parent.original.name_full if parent else ""
            rays = self._rays(thing, parent)
            shown = self._shown[key] = rays, self.links.number(name, above) if rays else 0
        if not shown[0]:
            return
        if thing.type in FACELESS:
            self._faceless[own.name] = None
            return
        matrix = np.array(instance.matrix_world, np.float64)
        if thing.type == "MESH":
            self._placed.append(self._mesh_and_look(thing, pointer))
            self._matrices.append(matrix)
            self._seen.append(shown)
        elif not (np.abs(matrix) <= LARGEST_COORDINATE).all():
            self._bad_place[own.name] = None
        else:
            self._add_lamp(thing, matrix)

    def _add_lamp(self, thing, matrix: Array) -> None:
        lamp, own = thing.data, thing.original
        pointer = lamp.as_pointer()
        if pointer not in self._tints:
            self._tints[pointer] = read_tint(lamp)
        tint, notes = self._tints[pointer]
        light = read_light(lamp, matrix, tint)
        if light is None:
            return
        self.links.add(len(self.lights), own)
        self.lights.append(replace(light, scattered=thing.visible_diffuse, mirrored=thing.visible_glossy))
        for note in notes:
            self._uneven.setdefault(note, {})[own.name] = None

    def _rays(self, thing, parent) -> int:
        """Which rays meet an object, as ``visible_rays``; 0 for what is not rendered."""
        own = thing.original
        top = parent.original if parent else own
        if own.name_full in self._left_out or top.name_full in self._left_out:
            return 0
        if self._rendered is not None and not self._is_rendered(own, top):
            return 0
        return EVERYWHERE if thing.type == "LIGHT" else visible_rays(thing, parent, self._view_layer)

    def _is_rendered(self, own, top) -> bool:
        """Whether a render shows what a viewport's depsgraph lists; a render's lists nothing else.

        top: what instances ``own``, or ``own`` itself. A hidden object can still be
        instanced, on vertices or by nodes; only instanced collections leave it out.
        """
        if top.hide_render or top.name_full not in self._rendered:
            return False
        return not own.hide_render or top.instance_type != "COLLECTION"

    def _mesh_and_look(self, thing, pointer: int) -> tuple[int, int]:
        mesh_pointer = thing.data.as_pointer()
        mesh = self._mesh_numbers.get(mesh_pointer)
        if mesh is None:
            mesh = self._mesh_numbers[mesh_pointer] = len(self.meshes)
            self.meshes.append(of_mesh(thing, lambda data: read_mesh(data, self._with_uv)))
        look = self._look_numbers.get((pointer, mesh_pointer))
        if look is None:
            look = self._look_numbers[pointer, mesh_pointer] = len(self._looks)
            name = thing.original.name_full
            number = self.object_numbers.setdefault(name, len(self.object_numbers))
            if number == len(self.pass_indices):
                self.pass_indices.append(thing.pass_index)
            used = [slot.material for slot in thing.material_slots]
            slots = [self.materials.number(one) for one in ([self._material] if self._material else used)]
            self._looks.append((number, slots or [0]))
            self._read_layers(thing, mesh, slots)
            if not self.meshes[mesh].finite:
                self._bad_shape[name] = None
        return mesh, look

    def _read_layers(self, thing, mesh: int, slots: list[int]) -> None:
        """Read the layers that the materials ask for and that were not read of the mesh before."""
        graphs = [self.materials.graphs[number] for number in set(slots) & self.materials.graphs.keys()]
        arrays = self.meshes[mesh]
        wanted = {name for graph in graphs for name in graph.layers} - arrays.layers.keys()
        if not wanted:
            return
        found = of_mesh(thing, lambda data: {name: read_layer(data, name) for name in wanted})
        for name, values in found.items():
            if values is not None:
                arrays.layers[name] = values if arrays.kept is None else values[arrays.kept]
            elif name.partition(":")[2] in thing.vertex_groups:
                self._vertex_groups[name.partition(":")[2]] = None

    def complete(self) -> None:
        """Write out the normals that are the triangles' own, if other meshes have any that are not."""
        if all(mesh.normals is None or not len(mesh.triangles) for mesh in self.meshes):
            return
        for number, mesh in enumerate(self.meshes):
            if mesh.normals is None:
                normals = own_normals(mesh.vertices, mesh.triangles)
                self.meshes[number] = replace(mesh, normals=normals)

    def instances(self) -> Instances:
        """All that was added and stands at a finite place, as arrays."""
        placed = np.array(self._placed, np.int32).reshape(-1, 2)
        matrix = np.array(self._matrices).reshape(-1, 4, 4)
        look_object = np.array([number for number, _ in self._looks], np.int32)
        seen = np.array(self._seen, np.int32).reshape(-1, 2)
        finite = (np.abs(matrix) <= LARGEST_COORDINATE).all(axis=(1, 2))
        names = list(self.object_numbers)
        for number in sorted(set(look_object[placed[~finite, 1]].tolist())):
            self._bad_place[names[number]] = None
        return Instances(
            placed[finite, 0],
            placed[finite, 1],
            matrix[finite],
            look_object,
            np.array([number for _, slots in self._looks for number in slots], np.int32),
            np.cumsum([0, *(len(slots) for _, slots in self._looks)], dtype=np.int32),
            None if (seen[:, 0] == EVERYWHERE).all() else seen[finite, 0].astype(np.uint8),
            seen[finite, 1] if self.links else None,
        )

    def warnings(self) -> tuple[str, ...]:
        """One line for each way in which objects could not be shown."""
        found = (
            (self._bad_place, "Left out, as their transforms are not finite: "),
            (self._bad_shape, "Faces left out, as their vertices are not finite: "),
            (self._faceless, "Not shown, as they have no faces (hair, points, volumes, Grease Pencil): "),
            (self._vertex_groups, VERTEX_GROUPS),
        )
        lines = [text + listing(list(names)) for names, text in found if names]
        lines += [f"Not shown as it is: {note} (in {listing(list(n))})" for note, n in self._uneven.items()]
        return tuple(lines)


def _rendered_objects(view_layer) -> set[str]:
    """Full names of the objects in collections that are neither excluded nor hidden in renders."""
    names: set[str] = set()
    pending = [view_layer.layer_collection]
    while pending:
        layer = pending.pop()
        if not layer.collection.hide_render:
            if not layer.exclude:
                names.update(one.name_full for one in layer.collection.objects)
            pending.extend(layer.children)
    return names


def join(
    meshes: list[MeshArrays], instances: Instances, object_names: tuple[str, ...], with_uv: bool = False
) -> Geometry:
    """One triangle soup of all instances in world space. Raises SceneError if it is too large."""
    order = np.argsort(instances.mesh, kind="stable")
    counts = np.bincount(instances.mesh, minlength=len(meshes))
    triangles = sum(int(count) * len(mesh.triangles) for count, mesh in zip(counts, meshes, strict=True))
    vertices = sum(int(count) * len(mesh.vertices) for count, mesh in zip(counts, meshes, strict=True))
    if max(triangles, vertices) > MAXIMUM_TRIANGLES:
        raise SceneError(
            f"The scene has {triangles:,} triangles once every instance is counted, more than "
            f"{MAXIMUM_TRIANGLES:,}: hide instances or lower the subdivision"
        )
    smooth = any(mesh.normals is not None for mesh in meshes if len(mesh.triangles))
    short = shortage(triangles * BYTES_PER_TRIANGLE)
    if short:
        raise SceneError(
            f"The scene has {triangles:,} triangles once every instance is counted, which need about "
            f"{short[0]} of memory, and {short[1]} are free: hide instances or lower "
            "the subdivision"
        )
    alone = len(order) == 1 and triangles > 0
    result = Geometry(
        np.empty((vertices, 3)),
        # One mesh in one place keeps its own numbers.
        meshes[instances.mesh[0]].triangles if alone else np.empty((triangles, 3), np.int32),
        np.empty((triangles, 3, 3), np.float32) if smooth else None,
        _room(instances.slots, triangles),
        _room(instances.look_object, triangles),
        object_names,
        np.full((triangles, 3, 2), np.nan, np.float32) if with_uv else None,
    )
    normal_matrix, mirrored = normal_transforms(instances.matrix[:, :3, :3])
    triangle = vertex = done = 0
    blocks = []
    for mesh, count in zip(meshes, counts, strict=True):
        mine = order[done : done + count]
        done += count
        if len(mine) and len(mesh.triangles):
            _place(mesh, instances, mine, normal_matrix[mine], result, triangle, vertex)
            _turn_over(mirrored[mine], result, triangle, len(mesh.triangles))
            triangle += len(mine) * len(mesh.triangles)
            vertex += len(mine) * len(mesh.vertices)
            blocks.append((len(mesh.triangles), mesh.layers, mirrored[mine]))
    if result.corner_normals is not None:
        normalize(result.corner_normals)
    many = [len(meshes[number].triangles) for number in instances.mesh[order]]
    return replace(
        result,
        layers=join_layers(blocks, triangles),
        visibility=None if instances.visibility is None else np.repeat(instances.visibility[order], many),
        linked=None if instances.linked is None else np.repeat(instances.linked[order], many),
    )


def _room(numbers: NDArray[np.int32], triangles: int) -> NDArray[np.int32]:
    """For a number of each triangle; where there is but one it is that, which nobody can write."""
    alike = len(numbers) and (numbers == numbers[0]).all()
    return np.broadcast_to(numbers[:1], triangles) if alike else np.empty(triangles, np.int32)


def _place(
    mesh: MeshArrays,
    instances: Instances,
    mine: NDArray[np.int64],
    normal_matrix: NDArray[np.float32],
    into: Geometry,
    triangle: int,
    vertex: int,
) -> None:
    """Write the instances ``mine`` of a mesh into ``into``, from the given triangle and vertex on."""
    count, many, each = len(mine), len(mesh.triangles), len(mesh.vertices)
    own = slice(triangle, triangle + count * many)
    matrix, look = instances.matrix[mine], instances.look[mine]
    vertices = into.vertices[vertex : vertex + count * each].reshape(count, each, 3)
    turn(mesh.vertices, matrix[:, :3, :3], vertices, matrix[:, :3, 3])
    if into.triangles is not mesh.triangles:
        first = vertex + each * np.arange(count, dtype=np.int32)
        np.add(mesh.triangles, first[:, None, None], out=into.triangles[own].reshape(count, many, 3))
    if into.corner_normals is not None and mesh.normals is not None:
        normals = into.corner_normals[own].reshape(count, many, -1, 3)
        if normals.shape[2] == mesh.normals.shape[1]:
            turn(mesh.normals.reshape(-1, 3), normal_matrix, normals.reshape(count, -1, 3))
        else:
            turn(mesh.normals[:, 0], normal_matrix, normals[:, :, 0])
            normals[:, :, 1:] = normals[:, :, :1]
    # A face's slot that an object does not have is its last one.
    if into.material.flags.writeable:
        first, last = instances.first_slot[look], instances.first_slot[look + 1] - 1
        slot = np.minimum(first[:, None] + mesh.slot.clip(0), last[:, None])
        into.material[own].reshape(count, many)[:] = instances.slots[slot]
    if into.object_index.flags.writeable:
        into.object_index[own].reshape(count, many)[:] = instances.look_object[look][:, None]
    if into.uv is not None and mesh.uv is not None:
        into.uv[own].reshape(count, many, 3, 2)[:] = mesh.uv


def _turn_over(mirrored: NDArray[np.bool_], into: Geometry, triangle: int, many: int) -> None:
    """Reverse the corners of mirrored instances, so that geometric normals stay outside."""
    for start in triangle + many * np.flatnonzero(mirrored):
        own = slice(start, start + many)
        into.triangles[own] = into.triangles[own][:, [0, 2, 1]]
        if into.corner_normals is not None:
            into.corner_normals[own] = into.corner_normals[own][:, [0, 2, 1]]
        if into.uv is not None:
            into.uv[own] = into.uv[own][:, [0, 2, 1]]
