# SPDX-License-Identifier: GPL-3.0-or-later
"""Live View: viewports that look through a flexible camera show what its projectors see."""
