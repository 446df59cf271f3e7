# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's volume as it is at present, with all that tells a change of it."""

from __future__ import annotations

import numpy as np

from ..bridge.blender.rig_mark import has_other_animation
from ..bridge.camera.ordinary_camera import is_own_view
from ..bridge.camera.read_projection import read_projection
from ..bridge.render.image_size import image_aspect, image_size
from ..projection.volume.viewing_volume import Projection
from ..scanline.table.mapping_table import image_signature
from .rig_data import check_surfaces

# Image positions across and up at which changes of the volume are noticed.
NOTICED = 7


def may_move(camera) -> bool:
    """Return whether anything of the volume may be animated."""
    pending = [camera, *(slot.object for slot in camera.scfpf.surfaces if slot.object is not None)]
    seen = set()
    while pending:
        obj = pending.pop()
        if obj in seen:
            continue
        seen.add(obj)
        keys = getattr(obj.data, "shape_keys", None)
        if any(owner is not None and has_other_animation(owner) for owner in (obj, obj.data, keys)):
            return True
        if len(obj.constraints) or any(m.type != "NODES" for m in obj.modifiers):
            return True
        if obj.parent is not None:
            pending.append(obj.parent)
    return False


def look(camera, scene, depsgraph) -> tuple[Projection, tuple]:
    """The present projection and its signature.

    The signature is the structure, which nodes cannot follow, and the rest. Its last item is whether the
    volume is the camera's own view.
    """
    own = camera.scfpf
    check_surfaces(camera)
    projection = read_projection(camera, depsgraph, image_aspect(scene))
    surfaces = tuple(
        (slot.object.session_uid, slot.object.scfpf_surface.kind, slot.weight) for slot in own.surfaces
    )
    focus = camera.data.dof.focus_object
    picture = image_signature(camera, scene)
    structure = (surfaces, own.basis, own.reparameterisation, picture, focus and focus.session_uid)
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(0.0, 1.0, NOTICED),) * 2))
    points = projection.projectors(x, y).points.astype(np.float32).tobytes()
    is_own = is_own_view(projection, camera.evaluated_get(depsgraph), depsgraph)
    return projection, (structure, points, image_size(scene), own.pixel_error, is_own)
