# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines that show a viewing volume."""
