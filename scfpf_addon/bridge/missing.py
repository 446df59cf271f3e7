# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of another file that Blender has not found: empties stand in their places."""

from __future__ import annotations


def missing_text(obj) -> str:
    """What to do about an object whose file is gone or lacks it; empty for any other."""
    if obj is None or not obj.is_missing:
        return ""
    linked = obj.override_library.reference if obj.override_library else obj
    path = linked.library.filepath if linked and linked.library else "another file"
    return (
        f"'{obj.name}' is missing from '{path}': put that file back and open this one again, or choose its "
        "new place in the Outliner (Blender File, right-click the library, Relocate)"
    )
