# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines and marks drawn in viewports and Image Editors."""
