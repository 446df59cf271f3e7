# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact casting: first hits certified in float64."""
