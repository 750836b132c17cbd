# SPDX-License-Identifier: GPL-3.0-or-later
"""Write docs/settings.md, the reference of all settings, from their declarations."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from radarsim_addon.blender.plan import Measurement, PathOptions, RunSettings, render_settings
from radarsim_addon.contract import LinkBudget
from radarsim_addon.options import declared, settings_table
from radarsim_addon.signal import Cfar, ProcessOptions, Receiver, SpectrogramOptions
from radarsim_addon.signal.radar import PATTERNS, WAVEFORM_KINDS, Burst, Weather

PAGE = Path(__file__).resolve().parents[1] / "docs" / "settings.md"
_HEAD = """# Settings

Each setting has one name. Files (JSON) and Python use this name, in SI units. The window shows
the setting in a common unit, and the option of the command line ends with that unit:
`carrier_hz` is `--carrier-ghz`. Options leave out plain metres, seconds, kelvins and watts. A
`required` setting has no default in files; the presets of the window give it one.

In Python, [`settings(rig)`](reference/api-blender.md) returns the settings of a radar, with its
antennas as `.transmitter` and `.receiver`.

Written by `scripts/make_settings_page.py`; do not edit.
"""


def page() -> str:
    """Return the text of the page."""
    render = render_settings()
    parts = [_HEAD]

    def add(
        title: str, kind: type[Any], flags: Iterable[str] = (), known: Iterable[type[Any]] = ()
    ) -> None:
        """Add a table; settings equal to those of the classes `known` are only named."""
        before = {name: item for other in known for name, item in declared(other).items()}
        alike = [name for name, item in declared(kind).items() if before.get(name) == item]
        parts.append(f"## {title}\n\n{settings_table(kind, flags, alike)}")
        if alike:
            names = ", ".join(f"`{name}`" for name in alike)
            parts.append(f"In addition, as above: {names}.\n")

    add("Run (`radarsim render`)", RunSettings, [*render, "output_folder", "overwrite"])
    waveforms = list(WAVEFORM_KINDS.values())
    for number, (name, kind) in enumerate(WAVEFORM_KINDS.items()):
        add(f"Waveform `{name}`", kind, render, waveforms[:number])
    add("Burst", Burst, render)
    add("Measurement (`radarsim render`)", Measurement, render)
    add("Paths (`radarsim render`)", PathOptions, render, [Measurement])
    add("Link budget", LinkBudget)
    antennas = list(PATTERNS.values())
    for number, (name, kind) in enumerate(PATTERNS.items()):
        add(f"Antenna `{name}`", kind, known=antennas[:number])
    add("Weather (`radarsim render`, `radarsim process`)", Weather, render)
    processing = {
        "Processing": ProcessOptions,
        "Receiver": Receiver,
        "CFAR": Cfar,
        "Spectrogram": SpectrogramOptions,
    }
    for title, kind in processing.items():
        add(f"{title} (`radarsim process`)", kind, declared(kind))
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    sys.exit(0)
