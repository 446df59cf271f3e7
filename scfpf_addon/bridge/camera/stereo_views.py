# SPDX-License-Identifier: GPL-3.0-or-later
"""The views of a stereoscopic scene: the volume of each eye, as the camera's stereo settings place it.

Each eye's volume is an affine image of the camera's own, in camera space. Parallel and toe-in eyes move it
rigidly. Off-axis eyes shear it as well: points at the convergence distance stay in place in the image.
Formulas: ``camera_stereo3d_model_matrix`` and ``camera_stereo3d_shift_x`` in Blender's ``camera.cc``, so that
an ordinary camera is rendered as in Cycles.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from ...projection.typing import Array
from ...projection.user_error import Message, UserError
from ...projection.volume.spherical_stereo import SphericalStereo, may_be_spherical, spherical_eye
from ...projection.volume.viewing_volume import Projection
from ..blender.rig_mark import camera_behind
from .ordinary_camera import depth_plane, is_own_view, placement


class SideView(NamedTuple):
    """A view beside the camera's own, sheared like an off-axis eye's.

    offset: to the right, in the camera's units. focus: depth of the points that stay in place in the image.
    """

    offset: float
    focus: float


# "" is the camera itself, between the eyes.
Eye = Literal["", "LEFT", "RIGHT"] | SideView

# Blender's names of the two views that Stereo 3D has.
EYES: dict[str, Eye] = {"left": "LEFT", "right": "RIGHT"}
# Lens types for which Blender offers spherical stereo.
SPHERICAL_TYPES = {"PERSP", "PANO", "CUSTOM"}


def eye_of(render, view: str) -> Eye:
    """Return the eye that a view of a scene is for, "" unless the scene has Stereo 3D.

    render: bpy.types.RenderSettings. view: the name of the view.
    """
    return EYES.get(view, "") if render.use_multiview and render.views_format == "STEREO_3D" else ""


def view_camera(chosen, render):
    """Return the camera of a view for which Blender has chosen an object.

    A Cycles rig's camera stands for the flexible one. Raises UserError for a rig while views have
    cameras of their own: Blender finds these by their names, and the rig's camera has another name.
    """
    camera = camera_behind(chosen)
    if camera != chosen and render.use_multiview and render.views_format == "MULTIVIEW":
        raise UserError(
            "The views have no cameras of their own while '{0}' renders with Cycles: press "
            "Remove Cycles Setup",
            camera.name,
        )
    return camera


def seen_by(camera, eye: Eye) -> Array:
    """Return the affine (4, 4) matrix, in world space, that turns an evaluated camera's volume into an eye's.

    Raises UserError for a camera without a finite place.
    """
    place = placement(camera)
    return place @ eye_matrix(camera, eye) @ np.linalg.inv(place)


def eye_place(camera, eye: Eye) -> Array:
    """Return the rigid (4, 4) matrix from the space of an evaluated camera's eye to world space."""
    return placement(camera) @ _pose(camera.data.stereo, eye)


def eye_shift(camera, eye: Eye) -> float | None:
    """Return what an evaluated camera's eye adds to the horizontal shift of the camera's own lens.

    With it an ordinary camera at ``eye_place`` sees as the eye of the camera's own view does. None where none
    does: off-axis eyes of parallel lenses.
    """
    lens = camera.data
    sheared = np.linalg.inv(_pose(lens.stereo, eye)) @ eye_matrix(camera, eye)
    if lens.type == "ORTHO":
        return 0.0 if np.allclose(sheared, np.eye(4)) else None
    measure = lens.sensor_height if lens.sensor_fit == "VERTICAL" else lens.sensor_width
    return -float(sheared[0, 2]) * lens.lens / measure


def own_depth_plane(projection: Projection, camera, depsgraph, eye: Eye) -> Array | None:
    """The plane, see ``depth_plane``, that an ordinary camera's depth is measured from.

    None if a projection, world space, is not an evaluated camera's own view: then a depth is a length along
    the projector. projection: of the camera itself, between the eyes.
    """
    if is_spherical(projection, camera, eye):
        return None
    is_own = not camera.scfpf.enabled or is_own_view(projection, camera, depsgraph)
    return depth_plane(eye_place(camera, eye)) if is_own else None


def eye_projection(projection: Projection, camera, eye: Eye) -> Projection:
    """The projection of an eye of an evaluated camera, whose own is given, in world space."""
    if not eye:
        return projection
    if not is_spherical(projection, camera, eye):
        return projection.transformed(seen_by(camera, eye))
    place, stereo = placement(camera), camera.data.stereo
    merge = (stereo.pole_merge_angle_from, stereo.pole_merge_angle_to) if stereo.use_pole_merge else None
    convergence = math.inf if stereo.convergence_mode == "PARALLEL" else stereo.convergence_distance
    own = projection.transformed(np.linalg.inv(place))
    eyes = SphericalStereo(stereo.interocular_distance, convergence, merge)
    return spherical_eye(own, eyes, -1.0 if eye == "LEFT" else 1.0).transformed(place)


def _asks_spherical(camera, eye: Eye) -> bool:
    """Return whether an eye of an evaluated camera is to be one of spherical stereo."""
    is_eye = isinstance(eye, str) and bool(eye)
    return is_eye and camera.data.stereo.use_spherical_stereo and camera.data.type in SPHERICAL_TYPES


def is_spherical(projection: Projection, camera, eye: Eye) -> bool:
    """Return whether an eye of an evaluated camera turns with its direction. projection: the camera's own."""
    has_layers = any(layer.is_on for layer in camera.scfpf.layers)
    is_asked = _asks_spherical(camera, eye) and camera.scfpf.enabled and not has_layers
    return is_asked and may_be_spherical(projection)


def unseen_settings(projection: Projection, camera, eye: Eye) -> str:
    """Return a warning about an ignored stereo setting of an evaluated camera, "" without one.

    projection: the camera's own.
    """
    if _asks_spherical(camera, eye) and not is_spherical(projection, camera, eye):
        return Message(
            "Spherical stereo of '{0}' is left out, as its projectors are bent, or it has layers or holes: "
            "choose Parallel",
            camera.name,
        )
    return ""


def eye_matrix(camera, eye: Eye) -> Array:
    """``seen_by`` in camera space."""
    if not camera.scfpf.enabled:
        return frame_matrix(camera, eye)
    stereo = camera.data.stereo
    matrix = _pose(stereo, eye)
    if isinstance(eye, SideView):
        matrix[0, 2] = eye.offset / eye.focus
    elif stereo.convergence_mode == "OFFAXIS":
        # x + offset · (1 - depth / convergence distance)
        matrix[0, 2] = matrix[0, 3] / stereo.convergence_distance
    return matrix


def frame_matrix(camera, eye: Eye) -> Array:
    """``eye_matrix`` of an ordinary camera, or of the frame that Blender draws of a flexible one.

    Blender shifts the lens by a share of the sensor's width, whichever of its sides the shift is measured by.
    """
    lens, stereo = camera.data, camera.data.stereo
    matrix = _pose(stereo, eye)
    if stereo.convergence_mode != "OFFAXIS":
        return matrix
    shift = matrix[0, 3] / lens.sensor_width * lens.lens / stereo.convergence_distance
    if lens.type == "ORTHO":
        matrix[0, 3] -= shift * lens.ortho_scale
    else:
        measure = lens.sensor_height if lens.sensor_fit == "VERTICAL" else lens.sensor_width
        matrix[0, 2] = shift * measure / lens.lens
    return matrix


def _pose(stereo, eye: Eye) -> Array:
    """Return the rigid (4, 4) matrix from an eye's own space to camera space.

    stereo: bpy.types.CameraStereoData. The pivot is the eye that stays, or the middle.
    """
    matrix = np.eye(4)
    if isinstance(eye, SideView):
        matrix[0, 3] = eye.offset
        return matrix
    if not eye or stereo.pivot == eye:
        return matrix
    side = -1.0 if eye == "LEFT" else 1.0
    is_central = stereo.pivot == "CENTER"
    matrix[0, 3] = side * stereo.interocular_distance * (0.5 if is_central else 1.0)
    if stereo.convergence_mode != "TOE":
        return matrix
    angle = side * math.atan(0.5 * stereo.interocular_distance / stereo.convergence_distance)
    turn = np.eye(4)
    turn[[0, 2], [0, 2]] = math.cos(angle)
    turn[0, 2], turn[2, 0] = math.sin(angle), -math.sin(angle)
    # Away from the pivot the whole angle is turned, half of it before the step to the side.
    return matrix @ turn if is_central else turn @ matrix @ turn
