# SPDX-License-Identifier: GPL-3.0-or-later
"""Blends: cameras whose volumes are mixed from those of others, by a factor and by maps."""
