# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .settings_restorer import Recorder

__all__ = [
    "Recorder",
]
