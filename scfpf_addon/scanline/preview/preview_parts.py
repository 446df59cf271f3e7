# SPDX-License-Identifier: GPL-3.0-or-later
"""How the live preview is split: heavy objects have a picture each, light ones share one.

An edit makes the picture anew that shows what was edited, not the others. Pictures have a price of
their own, so that there are few.
"""

from __future__ import annotations

import numpy as np

# Faces that light objects of one picture have together, at most.
SHARED_FACES = 50_000
MOST_PARTS = 16
# A part is left as it is until it holds this many times what it should: moving objects has its price too.
OVERFULL = 2


def share_out(weights: dict[int, int], present: dict[int, int]) -> dict[int, int]:
    """The number of the part that each object belongs to, below MOST_PARTS.

    weights: faces by object. present: the part that objects are in now. Objects
    stay where they are unless a part has become much too heavy to be shared.
    """
    # Two parts that are filled one after the other hold more than one part may: there are no more of them.
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
    """Give every object that has none a part, the heaviest first; False if there are not enough parts."""
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
    """The faces of an object and of what it instances: as evaluated, where it is.

    depsgraph: None or evaluated; one that has not been evaluated yet has no geometry.
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
    return max(own, _geometry_faces(evaluated.evaluated_geometry(), depsgraph))


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
