# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user asks for, in SI and float64, checked. Standard library only.

The panel's float32 numbers and the headless script's options both end up in a `Measurement`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal

from ...contract import LinkBudget
from ...errors import ConfigError
from ...signal.radar import AnyWaveform, Burst, Radar

#: More rings than this is a slip of the pen (a ring step in kilometres, a scene in millimetres).
MAX_RINGS = 10_000
#: Pixels of one render; Cycles needs about 50 bytes for each.
MAX_PIXELS = 1 << 28


def shortest_decimal(value: float, exponent: int = 0) -> float:
    """The decimal number that the user typed into a float32 field, times ``10**exponent``.

    A Blender FloatProperty holds float32: 77 GHz as 77e9 would read back 76999999488. Seven
    significant digits are what float32 keeps of any typed number.
    """
    if not math.isfinite(value):
        return value
    return float(Decimal(f"{value:.7g}").scaleb(exponent))


def parse_frames(text: str) -> tuple[int, ...]:
    """Frames from ``"7"``, ``"1:10"`` (both ends included), ``"1:10:2"`` or commas between these.

    Raises
    ------
    ConfigError
        The text is none of these, or selects no frame.
    """
    frames: list[int] = []
    for part in text.split(","):
        try:
            numbers = [int(item) for item in part.split(":")]
        except ValueError:
            numbers = []
        if not 1 <= len(numbers) <= 3 or (len(numbers) == 3 and numbers[2] < 1):
            raise ConfigError(
                f"Frames {text!r} are not understood; expected FIRST, FIRST:LAST or "
                "FIRST:LAST:STEP with whole numbers and a step from 1, for example 1:10."
            )
        first = numbers[0]
        last = numbers[1] if len(numbers) > 1 else first
        frames.extend(range(first, last + 1, numbers[2] if len(numbers) == 3 else 1))
    if not frames:
        raise ConfigError(f"Frames {text!r} select none: the last one is before the first one.")
    return tuple(dict.fromkeys(frames))


#: Polarisations of a run, in the order of the scene attribute's values 0, 1, 2.
POLARISATIONS = ("average", "vertical", "horizontal")


@dataclass(frozen=True)
class Measurement:
    """One run: radar, rings, passes, frames and how they are rendered.

    Parameters
    ----------
    waveform, burst
        The radar's numbers; they do not change what is rendered.
    frames
        Blender frames, in the order in which they are rendered.
    rings
        Number of rings from range 0; 0 means: as many as the scene needs.
    ring_step_m
        Width of a ring in one-way range [m] (Delta r of Eq. 5).
    snapshots
        1: at t only; 2: at t and t + snapshot_interval_s, from which Doppler follows (Eq. 12).
    snapshot_interval_s
        Time between the passes [s].
    width_px, height_px, samples, seed
        Size of each render, Cycles samples a pixel, Cycles seed (the same for all renders).
    max_bounces
        Reflections after the first one: 0 keeps single reflections alone.
    extinction_length_m
        Normalising length of the Radar Material's extinction coefficient [m]; 0: one Blender unit.
    system
        Power budget, checked; None: the emitter's EIRP in all directions. It changes no render.
    polarisation
        Of waves that go through physical materials: one of `POLARISATIONS`.
    """

    waveform: AnyWaveform
    burst: Burst
    frames: tuple[int, ...]
    rings: int
    ring_step_m: float
    snapshots: int = 2
    snapshot_interval_s: float = 0.01
    width_px: int = 256
    height_px: int = 256
    samples: int = 16
    seed: int = 0
    max_bounces: int = 0
    extinction_length_m: float = 0.0
    system: LinkBudget | None = None
    polarisation: str = "average"

    def __post_init__(self) -> None:
        Radar(self.waveform, self.burst)  # the chirp must fit into the pulse interval
        if not self.frames:
            raise ConfigError("No frame is to be rendered; expected at least one.")
        if not all(0 <= frame < 1_000_000 for frame in self.frames):
            raise ConfigError(
                f"Frames {min(self.frames)} to {max(self.frames)} are asked for; "
                "expected frames from 0 to 999999. Shift the animation."
            )
        if not (math.isfinite(self.ring_step_m) and self.ring_step_m > 0):
            raise ConfigError(
                f"Ring step is {self.ring_step_m!r} m; expected a positive number of metres. "
                "250 m is what the paper uses; the range resolution does not depend on it."
            )
        if not 0 <= self.rings <= MAX_RINGS:
            raise ConfigError(
                f"Number of rings is {self.rings}; expected 1 to {MAX_RINGS}, or automatic."
            )
        if self.snapshots not in (1, 2):
            raise ConfigError(f"Number of passes is {self.snapshots}; expected 1 or 2.")
        if self.snapshots == 2 and not (
            math.isfinite(self.snapshot_interval_s) and self.snapshot_interval_s > 0
        ):
            raise ConfigError(
                f"Delta t is {self.snapshot_interval_s!r} s; expected a positive time between the "
                "two passes. 10 ms is a good value; one pass alone needs none."
            )
        for name, value, least in (
            ("Width", self.width_px, 1),
            ("Height", self.height_px, 1),
            ("Samples", self.samples, 1),
        ):
            if value < least:
                raise ConfigError(f"{name} is {value}; expected a whole number from {least}.")
        if self.width_px * self.height_px > MAX_PIXELS:
            raise ConfigError(
                f"A render of {self.width_px} x {self.height_px} pixels is asked for; "
                f"expected at most {MAX_PIXELS} pixels. Lower the resolution."
            )
        if not 0 <= self.max_bounces <= 1024:
            raise ConfigError(f"Bounces are {self.max_bounces}; expected 0 to 1024.")
        if not 0 <= self.seed < 2**31:
            raise ConfigError(f"Seed is {self.seed}; expected 0 to 2147483647.")
        if not (math.isfinite(self.extinction_length_m) and self.extinction_length_m >= 0):
            raise ConfigError(
                f"Extinction length is {self.extinction_length_m!r} m; "
                "expected a positive number of metres, or 0 for one Blender unit."
            )
        if self.polarisation not in POLARISATIONS:
            raise ConfigError(
                f"Polarisation is {self.polarisation!r}; expected one of "
                f"{', '.join(POLARISATIONS)}."
            )

    @property
    def radar(self) -> Radar:
        """Waveform and burst together."""
        return Radar(self.waveform, self.burst)

    def renders(self, rings: int) -> int:
        """Number of Cycles renders when the run has `rings` rings."""
        return len(self.frames) * self.snapshots * rings
