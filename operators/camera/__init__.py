# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators on flexible cameras: add, preset, blend, preview, engine and Cycles."""
