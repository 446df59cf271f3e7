# SPDX-License-Identifier: GPL-3.0-or-later
"""Ways from an image position to the scene and back."""
