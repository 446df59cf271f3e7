# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a frame, and of stylised images."""
