# SPDX-License-Identifier: GPL-3.0-or-later
"""Cells of the image: which of their chords are certainly empty, and the chords that a ray needs."""
