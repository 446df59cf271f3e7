# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's entry point: register and unregister, nothing else.

Imports stand inside the functions: pytest imports this file from the checkout's root.
"""


def _types():
    from .scfpf_addon import bridge, cycles, scanline

    return (*bridge.TYPES, *scanline.TYPES, *cycles.types())


def register():
    from . import operators, panels
    from .scfpf_addon import bridge, cycles, events
    from .scfpf_addon.bridge.render import type_registration
    from .scfpf_addon.engines import anchors_job
    from .scfpf_addon.farm import job_command

    type_registration.register_types(_types())
    bridge.register()
    cycles.register()
    anchors_job.register()
    job_command.register()
    events.register()
    operators.register()
    panels.register()


def unregister():
    from . import operators, panels
    from .scfpf_addon import bridge, cycles, events, scanline
    from .scfpf_addon.bridge.render import type_registration
    from .scfpf_addon.engines import anchors_job
    from .scfpf_addon.farm import job_command

    panels.unregister()
    operators.unregister()
    events.unregister()
    job_command.unregister()
    anchors_job.unregister()
    cycles.unregister()
    scanline.unregister()
    bridge.unregister()
    type_registration.unregister_types(_types())
