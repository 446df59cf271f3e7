# SPDX-License-Identifier: GPL-3.0-or-later
"""Data passes, light passes and Cryptomatte."""
