# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a scene, prepared for casting."""
