# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's API needs, whatever the extension makes of it."""
