# SPDX-License-Identifier: GPL-3.0-or-later
"""What a console shows: figures in columns, in the digits that a map's cells bear, and names."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass

from .figuretext import cell_width, decimals_for, fixed
from .rangedoppler import RangeDopplerMap

#: Unicode categories that steer a terminal or end a line: controls, formats (which turn the
#: direction of writing), halves of surrogates, line and paragraph separators.
_STEERING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})


def printable(text: str) -> str:
    """Text on one line that no terminal obeys: control characters as Python escapes them.

    Names of objects may hold any character, and files come from strangers.
    """
    return "".join(
        character.encode("unicode_escape").decode("ascii")
        if unicodedata.category(character) in _STEERING
        else character
        for character in text
    )


@dataclass(frozen=True)
class Digits:
    """Digits behind the point of ranges [m], range rates [m/s] and Doppler [Hz]."""

    range: int = 2
    rate: int = 3
    doppler: int = 2

    def range_text(self, range_m: float) -> str:
        """A range in metres, right-aligned."""
        return f"{fixed(range_m, self.range):>10} m"

    def motion_text(self, velocity_mps: float, doppler_hz: float) -> str:
        """Range rate and Doppler, right-aligned; what stands still has no sign."""
        rate = fixed(velocity_mps, self.rate, signed=True)
        doppler = fixed(doppler_hz, self.doppler, signed=True)
        return f"range rate {rate:>9} m/s   Doppler {doppler:>9} Hz"


def map_digits(rd_map: RangeDopplerMap | None) -> Digits:
    """Digits for what is interpolated between the cells of a map; at least the usual ones."""
    if rd_map is None:
        return Digits()
    step_hz = cell_width(rd_map.doppler_hz)
    step_mps = step_hz * rd_map.radar.waveform.wavelength_m / 2
    usual = Digits()
    return Digits(
        max(usual.range, decimals_for(cell_width(rd_map.range_m))),
        max(usual.rate, decimals_for(step_mps)),
        max(usual.doppler, decimals_for(step_hz)),
    )
