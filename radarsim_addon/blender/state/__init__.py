# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to the user's file that are taken back: settings are recorded and restored."""

from .settings_restorer import SettingsRestorer

__all__ = [
    "SettingsRestorer",
]
