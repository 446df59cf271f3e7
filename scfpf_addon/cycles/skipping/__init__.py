# SPDX-License-Identifier: GPL-3.0-or-later
"""Chords that rays of the Cycles rig skip, since nothing is in them."""
