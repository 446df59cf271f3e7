# SPDX-License-Identifier: GPL-3.0-or-later
"""Path-traced projectors: a rig of Ray Portal sheets along which Cycles' camera rays follow them.

Imports stand inside the functions: the pure modules are used and tested without bpy.
"""


def types():
    """Return the types that files and Blender's render job need: see ``bridge.render.type_registration``."""
    from . import rig_properties

    return (rig_properties,)


def register():
    from . import rig
    from .layers import layers_job

    rig.register()
    layers_job.register()


def unregister():
    from .layers import layers_job

    layers_job.unregister()
