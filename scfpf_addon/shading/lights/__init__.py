# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, the sky and shadows; and the culling of lights and of shadow casters."""
