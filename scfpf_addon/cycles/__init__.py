# SPDX-License-Identifier: GPL-3.0-or-later
"""Path-traced projectors: a rig of Ray Portal sheets along which Cycles' camera rays follow them.

Imports stand inside the functions: what is pure in here is used, and tested, without bpy.
"""


def register():
    from . import rig, rig_properties

    for module in (rig_properties, rig):
        module.register()


def unregister():
    from . import rig, rig_properties

    for module in (rig, rig_properties):
        module.unregister()
