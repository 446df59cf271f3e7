# SPDX-License-Identifier: GPL-3.0-or-later
"""Records and services that all of casting uses."""
