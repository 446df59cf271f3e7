# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of projectors that the preview's node groups read."""
