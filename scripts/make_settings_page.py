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

Each setting has one name. Files (JSON) and Python use the name in the tables, in SI units. The
window shows the same setting in the unit that people use, and options of the command line end with
that unit: `carrier_hz` is `--carrier-ghz`. Options leave out plain metres, seconds, kelvins and
watts. `scripts/make_settings_page.py` writes this page from the declarations in the code.

In Python, `radarsim_addon.blender.rig_settings.settings(rig)` returns the settings of a radar; its
antennas are `settings(rig).transmitter` and `settings(rig).receiver`.
"""


def page() -> str:
    """Return the text of the page."""
    render = render_settings()
    parts = [_HEAD]

    def add(title: str, kind: type[Any], flags: Iterable[str] = ()) -> None:
        parts.append(f"## {title}\n\n{settings_table(kind, flags)}")

    add("Run (`radarsim render`)", RunSettings, [*render, "output_folder", "overwrite"])
    for name, kind in WAVEFORM_KINDS.items():
        add(f"Waveform `{name}`", kind, render if name != "arbitrary" else ())
    add("Burst", Burst, render)
    add("Measurement (`radarsim render`)", Measurement, render)
    add("Paths (`radarsim render`)", PathOptions, render)
    add("Link budget", LinkBudget)
    for name, kind in PATTERNS.items():
        add(f"Antenna `{name}`", kind)
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
