# SPDX-License-Identifier: GPL-3.0-or-later
"""Image layers: first hits chosen among several volumes."""
