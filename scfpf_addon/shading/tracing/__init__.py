# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour of hits, and rays that mirrors, glass and transparency send on."""
