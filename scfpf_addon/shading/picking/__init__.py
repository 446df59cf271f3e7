# SPDX-License-Identifier: GPL-3.0-or-later
"""From an image position to the scene and back."""
