# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim in Blender: targets read into arrays, solved volumes written to control surfaces."""
