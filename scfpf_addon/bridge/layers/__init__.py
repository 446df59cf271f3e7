# SPDX-License-Identifier: GPL-3.0-or-later
"""Image layers: collections that other cameras see in a flexible camera's image."""
