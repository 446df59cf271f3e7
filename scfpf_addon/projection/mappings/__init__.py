# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings of the image: a stack over the re-parameterisation."""
