# SPDX-License-Identifier: GPL-3.0-or-later
"""The common base of the tools for volumes and surfaces."""

from ...scfpf_addon.bridge.camera.read_projection import is_lattice_volume
from .errors import BAD_INPUT, refused
from .local_view import show_in_local_view
from .target import flexible_camera_of, poll_flexible_camera


class Tool:
    """Errors become one line, and ``edit(context, camera)`` may return a line to report."""

    bl_options = {"REGISTER", "UNDO"}

    poll = classmethod(poll_flexible_camera)

    def execute(self, context):
        camera = flexible_camera_of(context)
        before = {slot.object for slot in camera.scfpf.surfaces}
        try:
            message = self.edit(context, camera)
        except BAD_INPUT as error:
            return refused(self, error)
        made = [slot.object for slot in camera.scfpf.surfaces if slot.object not in before]
        show_in_local_view(context, made)
        if message:
            self.report({"INFO"}, message)
        return {"FINISHED"}


def poll_two(cls, context):
    """A poll for tools that need a volume: two surfaces at least, or a lattice."""
    if not poll_flexible_camera(cls, context):
        return False
    slots = flexible_camera_of(context).scfpf.surfaces
    if len(slots) < 2 and not is_lattice_volume(slots):
        cls.poll_message_set("The volume needs at least two control surfaces: add one with +")
        return False
    return True
