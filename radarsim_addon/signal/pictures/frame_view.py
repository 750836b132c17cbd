# SPDX-License-Identifier: GPL-3.0-or-later
"""What pictures of a frame are drawn from, in files between two processes.

Levels are those of the cells that a picture has: joined cells keep the strongest one, so that a
frame takes about a megabyte and is read and drawn in some hundredths of a second.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from ...arrays import Real, read_npz
from ...typed_json import from_json
from ..detection import (
    Detection,
    DirectedDetection,
    FrameBudget,
    ObjectEcho,
    PathFinder,
    TargetPaths,
    matching_objects,
)
from ..products import FrameResult
from .echo import EchoAxes, echo_axes
from .figure import MOST_CELLS, cell_width, strongest
from .map import MapAxes, SpectrogramAxes, axes_of_map, spectrogram_axes

_AXES: dict[str, type] = {"map": MapAxes, "echo": EchoAxes, "spectrogram": SpectrogramAxes}
#: Paths of a target that are drawn.
_MOST_PATHS = 12


class Target(TypedDict):
    """A detection, or an object where nothing was detected; None where a number is not known.

    map_range_m and map_velocity_mps are its place in the map; lines_m the corners of its paths. The
    angles are those that an array measures, to the right and upwards.
    """

    name: str
    range_m: float
    velocity_mps: float
    map_range_m: float
    map_velocity_mps: float
    power_dbm: float | None
    rcs_dbsm: float | None
    snr_db: float | None
    power_error: float
    azimuth_deg: float | None
    elevation_deg: float | None
    lines_m: list[list[list[float]]]


@dataclass(frozen=True)
class FrameView:
    """Data of the pictures and lists of a frame."""

    #: Number and scene time [s].
    frame: int
    time_s: float
    #: Unit of levels, "dBW" or "dB".
    unit: str
    #: Wavelength at the carrier [m].
    wavelength_m: float
    #: Direction that the receiver looks in, from the world's +Y clockwise [deg].
    azimuth_deg: float
    #: Its field of view; 0: not known [deg].
    width_deg: float
    #: Objects with an echo, by name.
    objects: dict[str, Target]
    #: Targets that CFAR found, by falling SNR; None: no CFAR.
    detections: list[Target] | None
    #: Levels in dB and axes, by name.
    arrays: Mapping[str, Real]
    #: Axes of the pictures of levels, by the names of `_AXES`, as JSON.
    axes: Mapping[str, Any]
    #: Power of the strongest cell of each of these; `noise_power` is that of a cell of the map.
    tops: Mapping[str, float]
    noise_power: float = 0.0
    uncertain: str = ""
    #: Numbers in `targets` of those whose echoes the spectrogram was made of.
    spectrogram_rows: Collection[int] = ()

    @property
    def targets(self) -> list[Target]:
        """Targets of the list: detections. Without CFAR, the objects, the strongest first."""
        return list(self.objects.values()) if self.detections is None else self.detections

    @property
    def title(self) -> str:
        """Frame, time, and the note about uncertain powers."""
        text = f"frame {self.frame}, t = {self.time_s:.4g} s"
        return f"{text}, {self.uncertain}" if self.uncertain else text

    def levels(self, kind: str) -> tuple[Any, Real]:
        """Return axes and power of the drawn cells of "map", "echo" or "spectrogram"."""
        axes: Any = from_json(_AXES[kind], self.axes[kind], "Axes")
        return axes, 10 ** (self.arrays[f"{kind}_db"] / 10)

    def level_db(self, kind: str, right: float, up: float) -> float:
        """Return the level of the cell of a "map" (Doppler [Hz], range [m]) or a "spectrogram"
        (time [s], Doppler [Hz]) at a place within its axes [dB].
        """
        axes: Any = from_json(_AXES[kind], self.axes[kind], "Axes")
        if kind == "map":
            cells = (axes.doppler, axes.doppler_unit, right), (axes.ranges, axes.range_unit, up)
        else:
            cells = (axes.across, axes.time_unit, right), (axes.up, axes.doppler_unit, up)
        levels = self.arrays[f"{kind}_db"]
        place = []
        for (axis, unit, value), count in zip(cells, levels.shape, strict=True):
            part = (value / unit.size - axis.low) / (axis.high - axis.low)
            place.append(min(max(int(part * count), 0), count - 1))
        return float(levels[place[0], place[1]])


def _file(folder: Path, frame: int, ending: str) -> Path:
    return folder / f"view_{frame:06d}.{ending}"


def read_view(folder: Path, frame: int) -> FrameView:
    """Read what `write_view` wrote."""
    record = json.loads(_file(folder, frame, "json").read_text(encoding="utf-8"))
    found = read_npz(_file(folder, frame, "npz"))
    arrays = {name: array.astype(np.float64) for name, array in found.items()}
    return FrameView(arrays=arrays, **record)


def write_view(result: FrameResult, folder: Path) -> None:
    """Write the data for pictures of a frame's result."""
    source, radar = result.source, result.rd_map.radar
    finder = PathFinder(source, FrameBudget(source).link) if source.tables else None
    interval_mps = 2 * radar.max_unambiguous_velocity_mps
    later_s = (radar.burst.pulses - 1) / 2 / radar.burst.prf_hz
    period_m = radar.range_period_m

    errors = {echo.name: echo.power_error for echo in result.budget.objects}

    def of_object(echo: ObjectEcho) -> Target:
        budget, rate = result.budget, echo.range_rate_mps
        place_m = echo.range_m + later_s * rate
        snr = budget.snr.get(echo.name)
        return Target(
            name=echo.name,
            range_m=echo.range_m,
            velocity_mps=rate,
            map_range_m=place_m % period_m if math.isfinite(period_m) else place_m,
            map_velocity_mps=(rate + interval_mps / 2) % interval_mps - interval_mps / 2,
            power_dbm=_finite(echo.power_dbm),
            rcs_dbsm=_finite(echo.rcs_dbsm),
            snr_db=None if snr is None else snr.burst_db,
            power_error=echo.power_error,
            azimuth_deg=None,
            elevation_deg=None,
            lines_m=_lines(finder.of_object(echo.name, _MOST_PATHS)) if finder else [],
        )

    def of_detection(item: Detection) -> Target:
        found = finder.of_target(item.range_m, item.velocity_mps, _MOST_PATHS) if finder else None
        watts = result.echoes.amplitude_model == "radar-equation"
        true_mps = item.unfolded_velocity_mps
        directed = item if isinstance(item, DirectedDetection) else None
        return Target(
            name=item.name if directed else found.name if found else "",
            range_m=item.range_m,
            velocity_mps=item.velocity_mps if true_mps is None else true_mps,
            map_range_m=item.range_m,
            map_velocity_mps=item.velocity_mps,
            power_dbm=item.level_db + 30 if watts else None,
            rcs_dbsm=directed.rcs_dbsm if directed else None,
            snr_db=item.snr_db,
            power_error=errors.get(found.last_object, 0.0) if found else 0.0,
            azimuth_deg=directed.azimuth_deg if directed else None,
            elevation_deg=directed.elevation_deg if directed else None,
            lines_m=_lines(found) if found else [],
        )

    detections = result.detections
    matrix, camera = np.asarray(source.receiver.matrix_world), source.receiver
    ahead = -matrix[:3, 2]
    perspective = camera.kind == "perspective"
    width = math.atan(camera.right) - math.atan(camera.left) if perspective else 0.0
    record: dict[str, Any] = {
        "frame": result.frame,
        "time_s": result.time_s,
        "unit": "dBW" if result.echoes.amplitude_model == "radar-equation" else "dB",
        "wavelength_m": radar.waveform.wavelength_m,
        "azimuth_deg": math.degrees(math.atan2(ahead[0], ahead[1])),
        "width_deg": math.degrees(width),
        "uncertain": result.budget.uncertain_text,
        "noise_power": result.map_noise_power,
        "objects": {echo.name: of_object(echo) for echo in result.budget.objects},
        "detections": None
        if detections is None
        else [of_detection(item) for item in detections.targets],
    }
    record["axes"], record["tops"], arrays = _drawn(result)
    targets = FrameView(**record, arrays={}).targets
    record["spectrogram_rows"] = _spectrogram_rows(result, targets)
    np.savez(_file(folder, result.frame, "npz"), **arrays)
    text = json.dumps(record)
    _file(folder, result.frame, "json").write_text(text, encoding="utf-8")


def _spectrogram_rows(result: FrameResult, targets: list[Target]) -> list[int]:
    """Return the indices of the targets that lie within the ranges of the spectrogram and, if it
    shows some objects only, belong to these.
    """
    shown = result.spectrogram
    if shown is None:
        return []
    low_m, high_m = shown.range_limits_m
    wanted = shown.options.object_name
    names = None if wanted is None else matching_objects(result.source, wanted)
    return [
        row
        for row, item in enumerate(targets)
        if low_m <= item["map_range_m"] <= high_m and (names is None or item["name"] in names)
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _lines(found: TargetPaths) -> list[list[list[float]]]:
    """Return corners of paths, to a tenth of a millimetre."""
    return [np.round(line, 4).tolist() for line in found.lines_m]


def _drawn(result: FrameResult) -> tuple[dict[str, Any], dict[str, float], dict[str, Any]]:
    """Return axes, strongest powers, and arrays; levels [dB] as float16, whose step is 0.06 dB at
    -100 dB.
    """
    profile, echoes = result.profile, result.echoes.channel(0)
    step = -(-profile.range_m.size // MOST_CELLS)
    first_m, width_m = float(profile.range_m[0]), cell_width(profile.range_m)
    power = strongest(profile.power, (step,))
    arrays: dict[str, Any] = {
        "profile": power,
        "profile_range_m": first_m + width_m * ((step - 1) / 2 + step * np.arange(power.size)),
    }
    of_echo, of_map = echo_axes(echoes), axes_of_map(result.rd_map)
    shown: dict[str, tuple[Any, Real, tuple[int, int]]] = {
        "map": (of_map, result.rd_map.power[0], (of_map.doppler.step, of_map.ranges.step)),
        "echo": (of_echo, np.abs(echoes.plane) ** 2, (of_echo.along.step, of_echo.across.step)),
    }
    if result.spectrogram is not None:
        own = spectrogram_axes(result.spectrogram)
        shown["spectrogram"] = own, result.spectrogram.power, (own.across.step, own.up.step)
    for name, (_, cells, steps) in shown.items():
        joined = strongest(cells, steps)
        level = np.full(joined.shape, -300.0)
        np.log10(joined, out=level, where=joined > 0)
        level = np.where(joined > 0, np.maximum(10 * level, -300.0), -300.0)
        arrays[f"{name}_db"] = level.astype(np.float16)
    axes = {name: dataclasses.asdict(item[0]) for name, item in shown.items()}
    tops = {name: float(item[1].max(initial=0.0)) for name, item in shown.items()}
    return axes, tops, arrays


@dataclass(frozen=True)
class FrameProfile:
    """The profile of a frame, for pictures of all frames.

    power: (ranges,) [W]. azimuth_deg, width_deg: as of `FrameView`.
    """

    time_s: float
    range_m: Real
    power: Real
    azimuth_deg: float
    width_deg: float


def profile_of(view: FrameView) -> FrameProfile:
    """Return the profile of a frame."""
    arrays = view.arrays
    return FrameProfile(
        view.time_s, arrays["profile_range_m"], arrays["profile"], view.azimuth_deg, view.width_deg
    )
