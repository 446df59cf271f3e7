# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample positions in pixels, on lamps and on lenses, and how many samples pixels get."""
