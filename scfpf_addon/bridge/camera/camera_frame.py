# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's own frame of a flexible camera, kept small: it shows a lens that no picture is made with.

It stays as a handle to click on, and gets its size back when the camera becomes an ordinary one.
"""

from __future__ import annotations

# Its size at most, as a share of the ordinary clip end, which is about the volume's depth.
FRAME_SHARE = 1 / 64


def size_frame(camera) -> None:
    """Make a camera's frame small while it is flexible, and give it its size back afterwards.

    A size that the artist has set meanwhile stays, and so does camera data that another object shares or
    that cannot be edited.
    """
    settings, lens = camera.scfpf, camera.data
    before, given = settings.frame_sizes
    is_own = lens.is_editable and lens.users - lens.use_fake_user <= 1
    is_changed = given > 0.0 and lens.display_size != given
    if settings.enabled and is_own and not is_changed:
        before = before if given > 0.0 else lens.display_size
        lens.display_size = min(before, FRAME_SHARE * lens.clip_end)
        settings.frame_sizes = before, lens.display_size
    elif not settings.enabled and given > 0.0:
        if is_own and not is_changed:
            lens.display_size = before
        settings.frame_sizes = 0.0, 0.0
