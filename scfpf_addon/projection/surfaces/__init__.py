# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces: sheets Q(u, v) with their derivatives."""
