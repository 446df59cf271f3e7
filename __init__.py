# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's entry point: register and unregister, nothing else.

Imports stand inside the functions: pytest imports this file from the checkout's root.
"""


def register():
    from . import operators, panels
    from .scfpf_addon import bridge, cycles, scanline

    bridge.register()
    scanline.register()
    cycles.register()
    operators.register()
    panels.register()


def unregister():
    from . import operators, panels
    from .scfpf_addon import bridge, cycles, scanline

    panels.unregister()
    operators.unregister()
    cycles.unregister()
    scanline.unregister()
    bridge.unregister()
