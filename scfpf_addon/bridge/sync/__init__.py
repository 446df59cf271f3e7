# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers that keep volume objects and control surfaces in step with their cameras."""
