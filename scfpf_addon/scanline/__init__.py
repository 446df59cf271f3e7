# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview: node groups that invert the viewing volume, Q⁻¹: scene → (x, y, depth)."""

from .preview import preview, preview_properties

# Types that files and Blender's render job need: see ``bridge.render.type_registration``.
TYPES = (preview_properties,)


unregister = preview.unregister
