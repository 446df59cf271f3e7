# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume object of a flexible camera, and the Edit Volume mode."""
