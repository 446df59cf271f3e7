# SPDX-License-Identifier: GPL-3.0-or-later
"""The sheets of Ray Portals: mesh, nodes, passes."""
