# SPDX-License-Identifier: GPL-3.0-or-later
"""The distribution of objects among the parts of a nodes preview: a heavy object has a part of its own.

An edit has Blender recompute the part that shows the edited object, and no other. Each part has a cost of its
own, so there are few.
"""

from __future__ import annotations

import numpy as np

# Most faces that the objects of a shared part have together.
SHARED_FACES = 50_000
MOST_PARTS = 16
# A part stays as it is until it holds this many times as much: moving objects takes time too.
OVERFULL = 2


def share_out(weights: dict[int, int], present: dict[int, int]) -> dict[int, int]:
    """The number of the part that each object belongs to, below MOST_PARTS.

    weights: faces by object. present: each object's present part. Objects stay where they are unless a part
    has become much too heavy to be shared.
    """
    # Two parts filled one after the other hold more than this together: that bounds the number of parts.
    capacity = max(SHARED_FACES, -(-2 * sum(weights.values()) // (MOST_PARTS - 1)))
    loads: dict[int, int] = {}
    counts: dict[int, int] = {}
    result = {uid: present[uid] for uid in weights if uid in present}
    for uid, part in result.items():
        loads[part] = loads.get(part, 0) + weights[uid]
        counts[part] = counts.get(part, 0) + 1
    overfull = any(loads[part] > OVERFULL * capacity and counts[part] > 1 for part in loads)
    if not overfull and _fill(weights, loads, result, capacity):
        return result
    result = {}
    _fill(weights, {}, result, capacity)
    return result


def _fill(weights: dict[int, int], loads: dict[int, int], result: dict[int, int], capacity: int) -> bool:
    """Give every object without a part one, the heaviest first; return whether there were enough parts."""
    for uid in sorted(weights.keys() - result.keys(), key=lambda uid: (-weights[uid], uid)):
        fits = (
            part for part in range(MOST_PARTS) if part not in loads or loads[part] + weights[uid] <= capacity
        )
        part = next(fits, None)
        if part is None:
            return False
        result[uid] = part
        loads[part] = loads.get(part, 0) + weights[uid]
    return True


def face_count(candidate, depsgraph=None) -> int:
    """The number of faces of an object and its instances: evaluated ones, if the depsgraph has any.

    depsgraph: None, or evaluated; without an evaluation it has no geometry.
    """
    if candidate.type == "EMPTY":
        held = candidate.instance_collection
        return sum(face_count(one, depsgraph) for one in held.all_objects) if held is not None else 0
    own = len(candidate.data.polygons) if candidate.type == "MESH" else 0
    evaluated = candidate.evaluated_get(depsgraph) if depsgraph is not None else candidate
    if not evaluated.is_evaluated:
        return own
    if candidate.type == "MESH" and not any(modifier.type == "NODES" for modifier in candidate.modifiers):
        return max(own, len(evaluated.data.polygons))
    try:
        geometry = evaluated.evaluated_geometry()
    except TypeError:  # of a type without geometry, or not evaluated since viewports hide it
        return own
    return max(own, _geometry_faces(geometry, depsgraph))


def _geometry_faces(geometry, depsgraph) -> int:
    count = len(geometry.mesh.polygons) if geometry.mesh is not None else 0
    instances = geometry.instances_pointcloud()
    if instances is None or not len(instances.points):
        return count
    numbers = np.empty(len(instances.points), np.int32)
    instances.attributes[".reference_index"].data.foreach_get("value", numbers)
    references = geometry.instance_references()
    for reference, times in zip(references, np.bincount(numbers, minlength=len(references)), strict=True):
        count += int(times) * _reference_faces(reference, depsgraph)
    return count


def _reference_faces(reference, depsgraph) -> int:
    kind = type(reference).__name__
    if kind == "GeometrySet":
        return _geometry_faces(reference, depsgraph)
    if kind == "Collection":
        return sum(face_count(one, depsgraph) for one in reference.all_objects)
    return face_count(reference, depsgraph)
