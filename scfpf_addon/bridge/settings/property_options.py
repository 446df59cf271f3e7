# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that the properties of cameras and scenes share."""

from __future__ import annotations

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}


def noted(owner, context):
    """Do nothing: a property needs a callback for edits from Python to reach the depsgraph."""


# Of properties that can have keyframes, and of those that cannot.
ANIMATABLE = {"update": noted, "override": OVERRIDABLE}
STATIC = {"options": set(), **ANIMATABLE}
# Of properties that no panel shows.
MARK = {"options": {"HIDDEN"}, **ANIMATABLE}
