# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of cameras and scenes."""
