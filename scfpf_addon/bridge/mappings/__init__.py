# SPDX-License-Identifier: GPL-3.0-or-later
"""Image mappings of a camera: read and edited."""
