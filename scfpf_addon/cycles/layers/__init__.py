# SPDX-License-Identifier: GPL-3.0-or-later
"""Image layers through Cycles: one render a layer in a temporary scene, joined into one image."""
