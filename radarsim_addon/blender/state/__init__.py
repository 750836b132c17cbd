# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .settings_restorer import SettingsRestorer

__all__ = [
    "SettingsRestorer",
]
