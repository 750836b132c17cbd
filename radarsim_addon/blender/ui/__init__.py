# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

__all__ = []
