# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of a measurement, in SI and float64, checked. Standard library only.

The panel's float32 numbers and the headless script's options both end up in a `Measurement`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...contract import MAX_PIXELS, MAX_RINGS, LinkBudget
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ...signal.radar import AnyWaveform, Burst, Radar, Weather

#: Blender's own limit is a little larger.
LAST_FRAME = 999_999


def parse_frames(text: str) -> tuple[int, ...]:
    """Return the frames that a text selects.

    Parameters
    ----------
    text
        ``"7"``, ``"1:10"`` (both ends included), ``"1:10:2"``, or several of these with commas.

    Returns
    -------
    tuple of int
        Blender frames in the order of the text, each one once.

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
        _check_frames(first, last)
        frames.extend(range(first, last + 1, numbers[2] if len(numbers) == 3 else 1))
    if not frames:
        raise ConfigError(f"Frames {text!r} select none: the last one is before the first one.")
    return tuple(dict.fromkeys(frames))


def _check_frames(first: int, last: int) -> None:
    if not (first >= -LAST_FRAME and last <= LAST_FRAME):
        raise ConfigError(
            f"Frames {first} to {last} are asked for; expected frames from {-LAST_FRAME} to "
            f"{LAST_FRAME}. Move the animation."
        )


#: Setting of both sampling modes.
MAX_REFLECTIONS: dict[str, Any] = {
    "label": "Max reflections",
    "help": "Set the most reflections of a path. 1: single reflections, as in the paper",
    "minimum": 1,
    "maximum": 1025,
    "soft_maximum": 4,
}
#: Polarisations of a run, in the order of the scene attribute's values 0, 1, 2.
POLARISATIONS = ("average", "vertical", "horizontal")


@documented
@dataclass(frozen=True)
class Measurement:
    """One run: radar, rings, snapshots, frames and how they are rendered.

    Parameters
    ----------
    waveform, burst
        The radar's numbers; they do not change what is rendered.
    frames
        Blender frames, in the order in which they are rendered.
    link_budget
        Transmit power, antennas and losses, checked; None: the transmitter's EIRP in all
        directions. It changes no render.
    weather
        What the air takes. It changes no render either.
    """

    waveform: AnyWaveform
    burst: Burst
    frames: tuple[int, ...]
    rings: int = setting(
        "Number of rings",
        "Set the number of rings from range 0. 0: as many as the farthest point needs",
        minimum=0,
        maximum=MAX_RINGS,
        initial=0,
    )
    ring_step_m: float = setting(
        "Ring step",
        "Set the width of a ring in one-way range (Delta r of Eq. 5). One render each",
        unit="m",
        above=0.0,
        initial=250.0,
        digits=3,
        hint="250 m is what the paper uses; the range resolution does not depend on it.",
    )
    snapshots: int = setting(
        "Number of snapshots",
        "Choose the renders of each ring",
        2,
        choices=(
            ("1", "One", "At t alone: no Doppler"),
            ("2", "Two", "At t and after the snapshot interval, for Doppler (Eq. 12)"),
        ),
    )
    snapshot_interval_s: float = setting(
        "Snapshot interval",
        "Set the time between the snapshots. Below 2 ms float32 animation spoils the velocity",
        0.01,
        shown_in="ms",
        minimum=0.0,
        digits=3,
    )
    width_px: int = setting("Width", "Set the pixels across", 256, minimum=1, maximum=65536)
    height_px: int = setting("Height", "Set the pixels up", 256, minimum=1, maximum=65536)
    samples: int = setting(
        "Samples",
        "Set the paths per pixel. 1: exactly through the pixel's centre, one range per pixel. "
        "More: less noise, but pixels at edges mix ranges",
        16,
        minimum=1,
        maximum=1 << 20,
    )
    seed: int = setting(
        "Seed", "Set the seed of Cycles' random numbers", 0, minimum=0, maximum=2**31 - 1
    )
    max_reflections: int = setting(default=1, **MAX_REFLECTIONS)
    extinction_length_m: float = setting(
        "Extinction length",
        "Set the length to which the Radar Material's extinction is normalised. 0: one Blender "
        "unit",
        0.0,
        unit="m",
        minimum=0.0,
    )
    range_start_m: float = setting(
        "Range start", "Set the one-way range at which profile and map begin", 0.0, unit="m",
        minimum=0.0, digits=1,
    )  # fmt: skip
    range_stop_m: float = setting(
        "Range stop",
        "Set the one-way range at which profile and map end. 0: where the scene ends",
        0.0,
        unit="m",
        minimum=0.0,
        digits=1,
    )
    link_budget: LinkBudget | None = None
    weather: Weather = field(default_factory=Weather)
    polarisation: str = setting(
        "Polarisation",
        "Choose the polarisation of waves that go through physical materials",
        "average",
        choices=(
            ("average", "Average", "Half the power in the plane of incidence, half across it"),
            ("vertical", "Vertical", "Field in the vertical plane of the ray (world Z is up)"),
            ("horizontal", "Horizontal", "Field level"),
        ),
    )
    beyond_band: str = setting(
        "Beyond band",
        "Choose what media do at a carrier outside their band of validity",
        "hold",
        choices=(
            (
                "hold",
                "Hold",
                "Take the permittivity at the edge of the band, with a caution",
            ),
            ("extrapolate", "Extrapolate", "Continue the medium's equation, with a caution"),
            ("refuse", "Refuse", "Stop before the render"),
        ),
    )

    def __post_init__(self) -> None:
        Radar(self.waveform, self.burst)  # the chirp must fit into the pulse interval
        check_settings(self)
        if not self.frames:
            raise ConfigError("No frame is to be rendered; expected at least one.")
        _check_frames(min(self.frames), max(self.frames))
        if self.snapshots == 2 and not self.snapshot_interval_s > 0:
            raise ConfigError(
                f"Snapshot interval is {self.snapshot_interval_s!r} s; expected a positive time "
                "between the two snapshots. 10 ms is a good value; one snapshot alone needs none."
            )
        if (self.range_start_m or self.range_stop_m) and self.range_stop_m <= self.range_start_m:
            raise ConfigError(
                f"The range limits are {self.range_start_m:g} m to {self.range_stop_m:g} m; "
                "expected a stop beyond the start, or 0 for both: as far as the scene reaches."
            )
        if self.width_px * self.height_px > MAX_PIXELS:
            raise ConfigError(
                f"A render of {self.width_px} x {self.height_px} pixels is asked for; "
                f"expected at most {MAX_PIXELS} pixels. Lower the resolution."
            )

    @property
    def radar(self) -> Radar:
        """Waveform and burst together."""
        return Radar(self.waveform, self.burst)

    def renders(self, rings: int) -> int:
        """Number of Cycles renders when the run has `rings` rings."""
        return len(self.frames) * self.snapshots * rings
