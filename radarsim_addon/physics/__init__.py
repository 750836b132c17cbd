# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms of the measurement. Pure numpy: imports neither bpy nor the other halves."""
