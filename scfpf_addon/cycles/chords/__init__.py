# SPDX-License-Identifier: GPL-3.0-or-later
"""Chords planned for Cycles."""
