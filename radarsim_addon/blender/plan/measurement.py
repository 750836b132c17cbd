# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of a measurement, in SI and float64, checked. Standard library only.

The panel's float32 numbers and the headless script's options both end up in a `Measurement`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any

from ...contract import MAX_PIXELS, MAX_RINGS, LinkBudget
from ...errors import ConfigError
from ...options import check_settings, documented, setting
from ...signal.radar import (
    SINGLE_CHANNEL,
    AnyWaveform,
    Burst,
    Channel,
    Radar,
    Schedule,
    Weather,
    array_preset,
)

#: Blender's own limit is a little larger.
LAST_FRAME = 999_999


def parse_frames(text: str) -> tuple[int, ...]:
    """Return the frames that a text selects, in its order, each one once.

    It is ``"7"``, ``"1:10"`` (both ends included), ``"1:10:2"``, or several of these with commas.
    Raises ConfigError for another text, or one that selects no frame.
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

    Waveform, burst, link budget and weather do not change what is rendered.
    """

    waveform: AnyWaveform
    burst: Burst
    #: Blender frames, in the order in which they are rendered.
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
    #: Checked; None: the transmitter's EIRP in all directions.
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
            ("hold", "Hold", "Take the permittivity at the edge of the band, with a caution"),
            ("extrapolate", "Extrapolate", "Continue the medium's equation, with a caution"),
            ("refuse", "Refuse", "Stop before the render"),
        ),
    )

    array: str = setting(
        "Array",
        "Choose the elements that measure angles: transmitters x receivers",
        "single",
        choices=(
            ("single", "One Element", "No angles. A radar file may hold elements of its own"),
            ("1x4", "1 x 4", "4 receivers in a row"),
            ("1x8", "1 x 8", "8 receivers in a row"),
            ("8x8", "1 x 64 (8 x 8)", "64 receivers in a square: azimuth and elevation"),
            ("3x4", "3 x 4", "A single 77 GHz chip: 8 virtual elements in a row, 4 above"),
            ("12x16", "12 x 16", "Four 77 GHz chips: 86 virtual elements in a row, some above"),
        ),
    )
    array_schedule: Schedule = setting(
        "Transmitters",
        "Choose how several transmitters share the pulse interval",
        "tdm",
        choices=(
            ("tdm", "In Turn (TDM)", "Each in a slot of its own"),
            ("ddm", "Doppler Shifts (DDM)", "At once, each shifted in Doppler by its phases"),
            ("bpm", "Codes (BPM)", "At once, with phases of 0 and 180 degrees"),
        ),
    )
    #: Those of a radar file; a chosen array replaces them.
    channels: tuple[Channel, ...] = (SINGLE_CHANNEL,)

    def __post_init__(self) -> None:
        if self.array != "single":
            array = dataclasses.replace(
                array_preset(self.array, self.waveform.wavelength_m), schedule=self.array_schedule
            )
            object.__setattr__(
                self, "channels", array.channels(self.burst, self.waveform.duration_s)
            )
        elif self.array_schedule != "tdm" and len({one.tx for one in self.channels}) > 1:
            raise ConfigError(
                f"The schedule {self.array_schedule} is asked for, but the elements are those of a "
                'radar file, which has its own. Put "schedule" into its array, or choose a preset.'
            )
        self.radar  # noqa: B018  # the chirp must fit into the pulse interval
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
        """Waveform, burst and channels together."""
        return Radar(self.waveform, self.burst, self.channels)

    def renders(self, rings: int) -> int:
        """Number of Cycles renders when the run has `rings` rings."""
        return len(self.frames) * self.snapshots * rings


#: Below this pixel pitch, float32 rounds the camera's own directions [rad per pixel].
FINEST_PITCH = 5e-7


@documented
@dataclass(frozen=True)
class PathOptions:
    """How the sampling mode "paths" follows paths, and when refinement stops."""

    max_reflections: int = setting(default=1, **MAX_REFLECTIONS)
    max_depth: int = setting(
        "Transparent surfaces", "Set the most transparent surfaces on the receiver's side", 64,
        minimum=0, maximum=1000, window=False,
    )  # fmt: skip
    max_unfollowed_fraction: float = setting(
        "Max unfollowed fraction", "Set the fraction of the power that may stay unfollowed", 1e-4,
        minimum=0.0, maximum=1.0, window=False,
    )  # fmt: skip
    replicates: int = setting(
        "Replicates",
        "Set the replicates of each tile: renders with other sub-pixel offsets, whose scatter "
        "gives the standard error",
        4,
        minimum=1,
        maximum=10_000,
        soft_maximum=64,
    )
    max_standard_error: float = setting(
        "Target error",
        "Refine tiles until the relative standard error (over range bins and objects) is below "
        "this. 0: no refinement by error",
        0.0,
        shown_in="%",
        minimum=0.0,
        maximum=10.0,
        digits=2,
    )
    refine_for: str = setting(
        "Refine for",
        "Choose what the standard error is of",
        "both",
        choices=(
            ("both", "Both", "Half from range bins, half from objects"),
            ("ranges", "Ranges", "Range bins, weighed by the root of their power"),
            ("objects", "Objects", "The power of each object, all alike: small targets"),
        ),
    )
    time_limit_s: float = setting(
        "Time limit", "Stop refining a frame after this time. 0: no limit", 0.0, unit="s",
        minimum=0.0, maximum=1e9, digits=1,
    )  # fmt: skip
    max_refinement_level: int = setting(
        "Max refinement level", "Set the most halvings of the pixel pitch", 12,
        minimum=0, maximum=40, window=False,
    )  # fmt: skip
    tile_px: int = setting(
        "Tile size",
        "Set the side of a tile; without refinement, 256 means 512 in scenes of more than 250 "
        "objects",
        256,
        minimum=4,
        maximum=4096,
        window=False,
    )
    motion: str = setting(
        "Motion",
        "Choose how paths move during a burst",
        "kinematic",
        choices=(
            ("kinematic", "Kinematic", "Every path's length at every pulse, from what it touches"),
            ("off", "Off", "Everything is stationary during a burst"),
            ("linear", "Linear simulations", "Simulations as Blender: straight between frames"),
        ),
    )
    motion_samples: int = setting(
        "Max motion samples",
        "Set the most samples of the animation in a burst; fewer are taken where they are enough "
        "for the wavelength",
        4097,
        minimum=17,
        maximum=65_537,
    )
    visibility_updates: int = setting(
        "Visibility updates",
        "Set the renders per burst. More than one where visibility changes during a burst; echoes "
        "fade from one render to the next",
        1,
        minimum=1,
        maximum=1000,
        soft_maximum=16,
    )
    mirror_images: int = setting(
        "Mirror images",
        "Set the most images of the transmitter in planar mirrors (smooth Radar Materials), and in "
        "pairs of them; each is one more view. Mirrors count as reflections. 0: none",
        8,
        minimum=0,
        maximum=64,
        soft_maximum=16,
    )
    range_encoding: str = setting(
        "Range encoding",
        "Choose what carries the range encoding",
        "auto",
        choices=(
            ("auto", "Automatic", "By Radar Materials where everything has one, else by the world"),
            ("materials", "Materials", "Only objects with a Radar Material echo"),
            ("world", "World Volume", "Objects of any material echo"),
        ),
    )
    amplitude_channel: str = setting(
        "Amplitude channel",
        "Choose the channel that is the amplitude where materials are coloured",
        "mean",
        choices=(
            ("mean", "Mean", "Mean of red, green and blue"),
            ("R", "Red", "Red channel"),
            ("G", "Green", "Green channel"),
            ("B", "Blue", "Blue channel"),
        ),
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if self.max_reflections > 64:
            raise ConfigError(
                f"Max reflections is {self.max_reflections}; expected at most 64 with paths."
            )
        if self.refines and self.replicates < 2 and self.refine_for != "objects":
            raise ConfigError(
                f"Replicates is 1, and refinement is for {self.refine_for!r}. One replicate gives "
                "no standard error of range bins. Use at least 2 replicates, or refine for "
                "'objects'."
            )

    @property
    def error_scope(self) -> str:
        """What the reported error is of; with one replicate, of objects alone."""
        return "objects" if self.replicates == 1 else self.refine_for

    @property
    def refines(self) -> bool:
        """Whether tiles are refined at all."""
        return self.max_standard_error > 0 or self.time_limit_s > 0


_FRAME = {"minimum": -LAST_FRAME, "maximum": LAST_FRAME}


@documented
@dataclass(frozen=True)
class RunSettings:
    """Choices between records, and where a run goes; they are kept with the radar."""

    waveform_kind: str = setting(
        "Waveform",
        "Choose what is transmitted; a finished run can be processed with another one",
        "lfm",
        choices=(
            ("lfm", "LFM Pulse", "Linear chirp, one echo per pulse"),
            ("fmcw", "FMCW", "Linear chirps with de-chirp: the ADC samples the beat"),
            ("stepped", "Stepped Frequency", "One sample at each of many tones"),
            ("pmcw", "PMCW", "m-sequence of phases, sent without a pause"),
            ("barker", "Barker Pulse", "Pulse with a Barker code of phases"),
            ("file", "File", "Waveform and burst from a file (JSON)"),
        ),
    )
    waveform_file: str = setting(
        "Waveform file",
        "Read waveform and burst from a file (JSON, see docs/waveforms.md)",
        "",
        path="FILE",
        flag="--waveform",
    )
    use_link_budget: bool = setting(
        "Use link budget",
        "Use transmit power and antennas as given here. Off: the light's power is the EIRP in all "
        "directions, the receiver is isotropic",
        False,
    )
    sampling_mode: str = setting(
        "Sampling mode",
        "Choose how the scene is measured",
        "paths",
        choices=(
            ("rings", "Rings", "The paper's: shells of range, all paths of a shell in a pixel"),
            ("paths", "Paths", "One path per pixel: exact ranges, standard error reported"),
        ),
    )
    extinction: str = setting(
        "Extinction",
        "Choose the length to which the Radar Material's extinction coefficient kappa is "
        "normalised: power falls as exp(-4 pi kappa d / length) with the depth d",
        "length",
        choices=(
            ("length", "Length", "A length in metres, or one Blender unit"),
            ("wavelength", "Wavelength", "Makes the coefficient the physical one"),
        ),
    )
    frame_mode: str = setting(
        "Frames",
        "Choose the Blender frames that become radar frames",
        "current",
        choices=(
            ("current", "Current", "The current frame alone"),
            ("scene", "Scene Range", "The scene's frame range and step"),
            ("range", "Range", "First, last and step as given here"),
        ),
    )
    frame_start: int = setting("First", "Set the first frame", 1, **_FRAME)
    frame_end: int = setting("Last", "Set the last frame", 1, **_FRAME)
    frame_step: int = setting("Step", "Take every n-th frame", 1, minimum=1, maximum=LAST_FRAME)
    output_folder: str = setting(
        "Output",
        "Set the folder of the run; // is the folder of the .blend file. radarsim makes it where "
        "its parent exists",
        "//radar_run",
        path="DIR",
        flag="--out",
    )
    overwrite: bool = setting(
        "Overwrite",
        "Measure all frames again, in place of any run in the output folder. Off: the run of "
        "another scene is refused, and radarsim render resumes a stopped run of the same file",
        False,
    )
