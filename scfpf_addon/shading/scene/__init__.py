# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene as arrays: surfaces, the world, depth of field and motion."""
