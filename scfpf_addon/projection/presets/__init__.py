# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets: projections as JSON files."""
