# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene read into arrays: meshes, materials, lights, world, motion."""
