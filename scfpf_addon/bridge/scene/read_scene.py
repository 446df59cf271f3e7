# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``Scene`` of a depsgraph: triangles, normals, materials and lights as arrays in world space."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from dataclasses import replace

import numpy as np

from ...casting.common.ray_visibility import CAMERA, EVERYWHERE
from ...projection.typing import Array
from ...projection.user_error import Message, UserError
from ...shading.scene.shading_scene import Light, Scene
from . import read_lights
from .instances import Instance, MeshTable, copies_shown, instances, is_finite
from .join_meshes import Instances, join_meshes
from .light_paths import read_bounces, unshown_settings
from .mesh_arrays import LARGEST_COORDINATE, of_mesh, read_mesh
from .read_layers import read_layer
from .read_materials import MaterialTable, listing
from .read_visibility import LightLinks, ObjectKey, ShownInRenders, has_hair, unshown_parts
from .read_world import light_warnings, read_world, with_shadows, world_seen

# Types of objects without faces that Blender's own renders show.
FACELESS = {"CURVES", "POINTCLOUD", "VOLUME", "GREASEPENCIL"}

# The switches by which a view layer leaves out objects of a type.
FILTERS = {
    "MESH": "use_solid",
    "CURVES": "use_strand",
    "VOLUME": "use_volumes",
    "GREASEPENCIL": "use_grease_pencil",
}

NO_SURFACES = (
    "The view layer leaves out all surfaces: switch Surfaces on in View Layer Properties, Filter and Override"
)
# Warnings that names follow, in the order in which they are shown.
BAD_PLACE = Message("Left out, as their transforms are not finite: ")
BAD_SHAPE = Message("Faces left out, as their vertices are not finite: ")
NO_FACES = Message("Not shown, as they have no faces (hair, points, volumes, Grease Pencil): ")
BEHIND_GLASS = Message("Lamps are seen in mirrors, but not through glass: ")
VERTEX_GROUPS = Message("Vertex groups are 0 in materials unless they are stored as attributes: ")
NOTHING = Message("There is nothing to render: add an object with faces that is visible in renders")


def never() -> bool:
    """Cancel nothing."""
    return False


def read_scene(
    depsgraph,
    may_be_empty: bool = False,
    with_uv: bool = False,
    cancelled: Callable[[], bool] = never,
    image_layers: Mapping[int, int] | None = None,
    faceless: Set[str] = FACELESS,
) -> Scene:
    """Read everything that an image of the depsgraph's view layer shows.

    A render depsgraph (``render_depsgraph``) has objects as F12 shows them. A viewport one lacks objects that
    are hidden in the viewport and has the viewport's subdivision levels. Both leave out objects that are
    hidden in renders, excluded collections, objects that are visible to no ray and control surfaces. A
    hidden object is shown where nodes or vertices instance it, as by F12.

    may_be_empty: return a scene of no triangles with a warning if nothing can be shown. with_uv: read the
    texture coordinates of renders, too. cancelled(): whether to return the part that has been read.
    image_layers: the number of the image layer by an object's session id; that of an instancer comes first.
    faceless: the types of objects without faces of which a warning tells. Raises UserError if nothing can
    be shown otherwise, or memory cannot hold it.
    """
    reader = _SceneReader(depsgraph, with_uv, image_layers or {}, faceless)
    for instance in instances(depsgraph, reader.types, ShownInRenders(depsgraph)):
        if cancelled():
            break
        reader.add(instance)
    geometry = join_meshes(reader.meshes.rows, reader.instances(), tuple(reader.object_numbers), with_uv)
    geometry = reader.materials.met(geometry)
    visibility = geometry.visibility
    shown = len(geometry.triangles) > 0 if visibility is None else bool((visibility & CAMERA).any())
    wanted = depsgraph.view_layer_eval.use_solid
    if not shown and not may_be_empty:
        raise UserError(NOTHING if wanted else NO_SURFACES)
    world_color, world, world_warnings = read_world(depsgraph.scene_eval, depsgraph.view_layer_eval)
    if not (np.abs(world_color) <= LARGEST_COORDINATE).all():
        world_color = np.zeros(3)
        world_warnings = (
            *world_warnings,
            Message("The world's light is left out, as it is not finite: check the world's nodes"),
        )
    made = Scene(
        geometry=geometry,
        materials=reader.materials.materials(),
        lights=reader.links.linked(reader.lights),
        world_color=world_color,
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
    made = replace(made, warnings=made.warnings + light_warnings(made))
    return with_shadows(made, depsgraph.scene_eval.scfpf_sampling.world_shadows)


class _SceneReader:
    """Gathers instances; every mesh, material and visibility is read once."""

    def __init__(self, depsgraph, with_uv: bool, image_layers: Mapping[int, int], faceless: Set[str]) -> None:
        self._image_layers = image_layers
        self.meshes = MeshTable(lambda data: read_mesh(data, with_uv))
        self.object_numbers: dict[str, int] = {}
        self.pass_indices: list[int] = []
        self.lights: list[Light] = []
        self.materials = MaterialTable()
        self._scene = depsgraph.scene_eval
        evaluated = depsgraph.view_layer_eval
        self._filtered = {kind for kind, name in FILTERS.items() if not getattr(evaluated, name)}
        # Of the objects that are read.
        self.types = ({"MESH", "LIGHT"} | faceless) - self._filtered
        self._material = evaluated.material_override
        self.links = LightLinks()
        # By object and instancer: its ray visibility, the number by which lamps know it,
        # and the number of its image layer.
        self._shown: dict[ObjectKey, tuple[int, int, int]] = {}
        self._placed_shown: list[tuple[int, int, int]] = []
        self._look_numbers: dict[tuple[int, int], int] = {}
        self._looks: list[tuple[int, list[int]]] = []
        self._placed: list[tuple[int, int]] = []
        self._matrices: list[Array] = []
        # By warning, the names that follow it, as keys.
        self._lost: dict[str, dict[str, None]] = {
            text: {} for text in (BAD_PLACE, BAD_SHAPE, NO_FACES, BEHIND_GLASS, VERTEX_GROUPS)
        }
        # By lamp: the factor of its nodes, with notes; and by note: the names of objects, as keys.
        self._tints: dict[int, tuple[Array, tuple[str, ...]]] = {}
        self._notes: dict[str, dict[str, None]] = {}

    def add(self, instance: Instance) -> None:
        """Take an instance, without a reference to it."""
        obj, key = instance.obj, instance.key
        shown = self._shown.get(key)
        if shown is None:
            linked = self.links.number(key.name, key.owner_name)
            shown = self._shown[key] = instance.rays, linked, key.image_layer(self._image_layers)
        if obj.type == "MESH":
            self._placed.append(self._mesh_and_look(instance))
            self._matrices.append(instance.matrix)
            self._placed_shown.append(shown)
        elif obj.type != "LIGHT":
            self._lost[NO_FACES][obj.original.name] = None
        elif not is_finite(matrix := instance.matrix):
            self._lost[BAD_PLACE][obj.original.name] = None
        else:
            self._add_lamp(obj, matrix)

    def _add_lamp(self, obj, matrix: Array) -> None:
        lamp, own = obj.data, obj.original
        pointer = lamp.as_pointer()
        if pointer not in self._tints:
            factor, notes = read_lights.read_tint(lamp)
            self._tints[pointer] = factor, (*notes, *read_lights.unshown_parts(lamp, self._scene))
        tint, notes = self._tints[pointer]
        light = read_lights.read_light(lamp, matrix, tint)
        if light is None:
            return
        if light.has_extent and obj.visible_transmission:
            self._lost[BEHIND_GLASS][own.name] = None
        self.links.add(len(self.lights), own)
        self.lights.append(replace(light, diffuse=obj.visible_diffuse, specular=obj.visible_glossy))
        self._note(own, notes)

    def _note(self, own, notes: Iterable[str]) -> None:
        for note in notes:
            self._notes.setdefault(note, {})[own.name] = None

    def _note_object(self, obj) -> None:
        self._note(obj.original, unshown_parts(obj, self._scene))
        if "CURVES" not in self._filtered and has_hair(obj):
            self._lost[NO_FACES][obj.original.name] = None

    def _mesh_and_look(self, instance: Instance) -> tuple[int, int]:
        mesh, name = self.meshes.number(instance), instance.key.name
        look = self._look_numbers.setdefault((instance.key.uid, mesh), len(self._looks))
        if look == len(self._looks):
            obj = instance.obj
            self._note_object(obj)
            number = self.object_numbers.setdefault(name, len(self.object_numbers))
            if number == len(self.pass_indices):
                self.pass_indices.append(obj.pass_index)
            used = [slot.material for slot in obj.material_slots]
            slots = [self.materials.number(one) for one in ([self._material] if self._material else used)]
            self._looks.append((number, slots or [0]))
            self._read_layers(obj, mesh, slots)
            if not self.meshes.rows[mesh].finite:
                self._lost[BAD_SHAPE][name] = None
        return mesh, look

    def _read_layers(self, obj, mesh: int, slots: list[int]) -> None:
        """Read the layers that the materials use and that the mesh does not have yet."""
        graphs = [self.materials.graphs[number] for number in set(slots) & self.materials.graphs.keys()]
        arrays = self.meshes.rows[mesh]
        wanted = {name for graph in graphs for name in graph.layers} - arrays.layers.keys()
        if not wanted:
            return
        found = of_mesh(obj, lambda data: {name: read_layer(data, name) for name in wanted})
        for name, values in found.items():
            if values is not None:
                arrays.layers[name] = values if arrays.kept is None else values[arrays.kept]
            elif name.partition(":")[2] in obj.vertex_groups:
                self._lost[VERTEX_GROUPS][name.partition(":")[2]] = None

    def instances(self) -> Instances:
        """All instances with a finite transform that shows them, as arrays."""
        placed = np.array(self._placed, np.int32).reshape(-1, 2)
        matrix = np.array(self._matrices).reshape(-1, 4, 4)
        look_object = np.array([number for number, _ in self._looks], np.int32)
        shown = np.array(self._placed_shown, np.int32).reshape(-1, 3)
        names = list(self.object_numbers)
        for number in sorted(set(look_object[placed[~is_finite(matrix), 1]].tolist())):
            self._lost[BAD_PLACE][names[number]] = None
        kept = np.flatnonzero(copies_shown(placed[:, 0], matrix))
        return Instances(
            mesh=placed[kept, 0],
            look=placed[kept, 1],
            matrix=matrix[kept],
            look_object=look_object,
            slots=np.array([number for _, slots in self._looks for number in slots], np.int32),
            first_slot=np.cumsum([0, *(len(slots) for _, slots in self._looks)], dtype=np.int32),
            visibility=None if (shown[:, 0] == EVERYWHERE).all() else shown[kept, 0].astype(np.uint8),
            linked=shown[kept, 1] if self.links else None,
            image_layer=shown[kept, 2].astype(np.uint8) if self._image_layers else None,
        )

    def warnings(self) -> tuple[str, ...]:
        """One line for each reason why objects could not be shown."""
        if not self.materials.refracts:
            self._lost[BEHIND_GLASS].clear()
        lines = [Message("{0}{1}", text, listing(list(names))) for text, names in self._lost.items() if names]
        lines += [
            Message("Not shown as it is: {0} (in {1})", Message(note), listing(list(n)))
            for note, n in self._notes.items()
        ]
        return tuple(lines)
