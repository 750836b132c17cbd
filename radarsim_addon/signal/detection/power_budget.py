# SPDX-License-Identifier: GPL-3.0-or-later
"""Link budget of a frame: gains on paths, objects with their cross section, SNR and clutter.

`FrameBudget` applies the gains while paths stream by; its report then has the power of every
object, the SNR as a point target in the map (radar equation with the losses of the tapers and of
the canceller), and the clutter of the cell where the map shows the object.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...contract import LinkBudget
from ...findings import Finding, finding, finding_about, percent_text
from ...physics.radar_equation import SnrPrediction, predict_snr
from ...terminal import printable
from ..decoding import FrameInput
from ..echoes import pulse_times_s
from ..maps import ExpectedPower, coherent_samples, map_noise_gain, mti_response
from ..paths import Paths
from ..radar import FmcwWaveform, Radar, RadarSystem, Weather, make_system
from ..scattering import ClutterSurfaces, Link, antenna_motion
from .objects import ObjectEcho, received_echoes


@dataclass(frozen=True)
class CellClutter:
    """Clutter in the cell of the map where an object is."""

    #: Expected power of clutter there, and its standard error.
    clutter_w: float
    clutter_error_w: float
    #: Of the object as a point in the middle of the cell; None: no clutter is there.
    signal_to_clutter_db: float | None
    #: None: no clutter there, or no noise is known.
    clutter_to_noise_db: float | None


@dataclass(frozen=True)
class ClutterBudget:
    """Clutter of a frame, in the range-Doppler map without a canceller."""

    #: Objects that are clutter.
    surfaces: frozenset[str]
    #: Expected power of clutter in its strongest cell, and where that is.
    strongest_w: float
    range_m: float
    velocity_mps: float
    #: Mean noise of a cell of the map; None: unknown.
    noise_w: float | None
    #: By the name of each other object in the map.
    objects: Mapping[str, CellClutter] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return the record for ``_summary.json``."""
        return {
            "surfaces": sorted(self.surfaces),
            "strongest_w": self.strongest_w,
            "strongest_range_m": self.range_m,
            "strongest_velocity_mps": self.velocity_mps,
            "strongest_clutter_to_noise_db": ratio_db(self.strongest_w, self.noise_w),
        }

    def of_object(self, name: str) -> dict[str, Any] | None:
        """Return the record of an object. None for clutter, and for objects that the map does not
        show.
        """
        return dataclasses.asdict(self.objects[name]) if name in self.objects else None

    def line(self) -> str:
        """Return text for people."""
        text = (
            f"clutter ({', '.join(map(printable, sorted(self.surfaces))) or 'rain'}) up to "
            f"{10 * math.log10(self.strongest_w) + 30:.2f} dBm in a cell of the map "
            f"({self.range_m:.6g} m, {self.velocity_mps:z.3g} m/s)"
        )
        over_db = ratio_db(self.strongest_w, self.noise_w)
        return text if over_db is None else f"{text}: {over_db:.1f} dB over noise"


#: Fraction of a frame's power in paths of unknown last vertex that is worth a warning.
_GUESSED_SHARE = 1e-3
#: Objects below this level relative to the strongest one are rounding [dB].
_LEAST_DB = -200.0
#: Power fraction of an echo after the canceller below which it is not in the map.
_CANCELLED = 1e-20


@dataclass(frozen=True)
class BudgetReport:
    """Power budget of a frame."""

    #: Expected power of all paths. Those of path tables that share a scatterer interfere.
    received_w: float
    #: Thermal noise of one complex sample at the receiver's input; None without a link budget.
    noise_w: float | None
    #: Objects that echo, the strongest first; none for rings.
    objects: list[ObjectEcho] = field(default_factory=list)
    #: By the object's name, where there is a system and the object is in the map.
    snr: dict[str, SnrPrediction] = field(default_factory=dict)
    #: What to know before you trust the powers.
    findings: list[Finding] = field(default_factory=list)
    #: Why an object is not in the map, by its name.
    excluded_reason: dict[str, str] = field(default_factory=dict)
    #: None: no clutter, or a canceller before the map.
    clutter: ClutterBudget | None = None

    def summary(self) -> dict[str, Any]:
        """Return the record for ``_summary.json``: powers in W and dBm, RCS in m^2 and dBsm."""
        return {
            "received_w": self.received_w,
            "received_dbm": _dbm(self.received_w),
            "noise_w": self.noise_w,
            "noise_dbm": None if self.noise_w is None else _dbm(self.noise_w),
            "clutter": None if self.clutter is None else self.clutter.summary(),
            "objects": [
                {
                    **dataclasses.asdict(echo),
                    "power_dbm": _dbm(echo.power_w),
                    "rcs_dbsm": ratio_db(echo.rcs_m2, 1.0),
                    "predicted_snr": dataclasses.asdict(self.snr[echo.name])
                    if echo.name in self.snr
                    else None,
                    "excluded_reason": self.excluded_reason.get(echo.name),
                    "clutter": None if self.clutter is None else self.clutter.of_object(echo.name),
                }
                for echo in self.objects
            ],
        }

    @property
    def uncertain_text(self) -> str:
        """Note for a picture about objects with an uncertain power. Empty without any."""
        names = [printable(echo.name) for echo in self.objects if echo.uncertain]
        if not names:
            return ""
        # Of several, the finding names others first.
        return f"power of {f'{len(names)} objects' if len(names) > 1 else names[0][:24]} uncertain"

    def lines(self) -> list[str]:
        """Return text for people, one object per line."""
        found = []
        if self.noise_w is not None:
            found.append(
                f"received {_text(_dbm(self.received_w))} dBm in all, noise "
                f"{_text(_dbm(self.noise_w))} dBm per sample"
            )
        if self.clutter is not None:
            found.append(self.clutter.line())
        for echo in self.objects:
            line = (
                f"{printable(echo.name):20.20} {_range_text(echo.range_m)} m   "
                f"{_text(_dbm(echo.power_w))} dBm   RCS {_text(ratio_db(echo.rcs_m2, 1.0))} dBsm"
            )
            if echo.power_w > 0:
                line += f" +- {percent_text(echo.power_error)}{', uncertain' * echo.uncertain}"
            if echo.name in self.snr:
                line += f"   SNR in the map {self.snr[echo.name].burst_db:.1f} dB (as a point)"
            line += self._clutter_text(echo.name)
            if echo.name in self.excluded_reason:
                line += f"   not in the map: {self.excluded_reason[echo.name]}"
            found.append(line)
        return found

    def _clutter_text(self, name: str) -> str:
        if self.clutter is None or name not in self.clutter.objects:
            return "   clutter" if self.clutter and name in self.clutter.surfaces else ""
        cell = self.clutter.objects[name]
        over, noise = cell.signal_to_clutter_db, cell.clutter_to_noise_db
        text = "   no clutter there" if over is None else f"   {over:.1f} dB over clutter"
        return text if noise is None else f"{text}, clutter {noise:z.1f} dB over noise"


class FrameBudget:
    """Applies a link budget to the paths of a frame as they stream by.

    Without a link budget only the weather changes its paths.
    """

    def __init__(self, frame_input: FrameInput, weather: Weather | None = None) -> None:
        self._input, self._radar = frame_input, frame_input.radar
        self.system: RadarSystem | None = None
        self.link: Link | None = None
        scene = frame_input.table.motion if frame_input.tables else None
        #: Poses of the antennas, for the elements of an array.
        self.antennas = antenna_motion(frame_input.receiver, frame_input.transmitter, scene)
        waveform, eirp_w = self._radar.waveform, frame_input.transmitter.eirp_w
        air_db_per_km = (weather or Weather()).attenuation_db_per_km(waveform.carrier_hz)
        record = frame_input.link_budget
        if record is not None:
            self.system = make_system(record, waveform.wavelength_m)
        elif air_db_per_km > 0:  # isotropic antennas with the power of the renders change nothing
            record = LinkBudget(transmit_power_w=eirp_w)
        if record is not None:
            self.link = Link(
                self.system or make_system(record, waveform.wavelength_m),
                frame_input.receiver,
                frame_input.transmitter,
                scene,
                pulse_times_s(self._radar),
                air_db_per_km,
            )

    def apply(self, paths: Paths, of_table: bool = False) -> Paths:
        """Return the paths with the link budget's gains; `of_table`: paths of the frame's table."""
        return paths if self.link is None else self.link.apply(paths, of_table)

    def report(
        self,
        received_w: float,
        range_taper: str = "hamming",
        doppler_taper: str = "hamming",
        *,
        range_limits_m: tuple[float, float] | None = None,
        mti: int = 0,
        expected: ExpectedPower | None = None,
        receiver_gain: float = 1.0,
    ) -> BudgetReport:
        """Return objects, noise and predictions, after all paths were seen.

        `received_w` is the sum of the powers of a frame without tables; with tables it is their
        expected power. The tapers are those of the predicted SNR, `range_limits_m` the one-way
        ranges of the map (None: all), `mti` the pulses of the canceller before it (0: none),
        `expected` gives its clutter, `receiver_gain` is the G_r of a run without a link budget.
        """
        radar, system = self._radar, self.system
        objects: list[ObjectEcho] = []
        if self._input.tables:
            objects, received_w = received_echoes(self._input, radar.waveform.carrier_hz, self.link)
            received_w *= receiver_gain
            least = 10 ** (_LEAST_DB / 10) * max((echo.power_w for echo in objects), default=0.0)
            objects = [
                dataclasses.replace(
                    echo,
                    power_w=receiver_gain * echo.power_w,
                    power_error_w=receiver_gain * echo.power_error_w,
                    multi_object_power_w=receiver_gain * echo.multi_object_power_w,
                )
                for echo in objects
                if echo.power_w > least
            ]
        noise_w = None
        snr = {}
        shown = {echo.name: _shown_range(echo, radar, range_limits_m) for echo in objects}
        absent = {name: why for name, why in shown.items() if isinstance(why, str)}
        if system is not None:
            noise_w = system.noise_power_w(radar.waveform.sampling_rate_hz)
            if noise_w > 0:
                for echo in objects:
                    left = _canceller_gain(echo, radar, mti)
                    if left < _CANCELLED:
                        absent.setdefault(echo.name, "cancelled by the MTI")
                    if echo.name not in absent:
                        point = predicted_snr(
                            echo.power_w, radar, system, range_taper, doppler_taper
                        )
                        burst_db = point.burst_db + 10 * math.log10(left)
                        snr[echo.name] = dataclasses.replace(point, burst_db=burst_db)
        clutter = None
        if expected is not None and not mti:
            clutter = clutter_budget(
                expected,
                ClutterSurfaces(self._input).names,
                {
                    echo.name: (echo, range_m)
                    for echo in objects
                    if not isinstance(range_m := shown[echo.name], str)
                },
                radar.waveform.wavelength_m,
                noise_w
                and noise_w * map_noise_gain(radar, range_taper, doppler_taper) / radar.slots,
            )
        found = self._findings(objects)
        return BudgetReport(received_w, noise_w, objects, snr, found, absent, clutter)

    def _findings(self, objects: list[ObjectEcho]) -> list[Finding]:
        found, link = projection_findings(self._input), self.link
        if link is not None and link.seen_w and link.guessed_w >= _GUESSED_SHARE * link.seen_w:
            fraction = link.guessed_w / link.seen_w
            found.append(
                finding("transmit-gain-approximated", fraction=fraction, count=link.guessed)
            )
        if uncertain := {
            echo.name: {"stderr_fraction": echo.power_error} for echo in objects if echo.uncertain
        }:
            found.append(finding_about("power-uncertain", uncertain))
        return found


def _canceller_gain(echo: ObjectEcho, radar: Radar, mti: int) -> float:
    """Return the power gain of a canceller at the object's mean Doppler, relative to noise."""
    if not mti:
        return 1.0
    doppler_hz = -2 * echo.range_rate_mps / radar.waveform.wavelength_m
    # the canceller also shortens the burst
    fraction = (radar.burst.pulses - mti + 1) / radar.burst.pulses
    return float(mti_response(mti, doppler_hz, radar.burst.prf_hz)) * fraction


def _shown_range(
    echo: ObjectEcho, radar: Radar, range_limits_m: tuple[float, float] | None
) -> float | str:
    """Return the range at which the map shows an object [m], or a text that says why it
    does not.
    """
    waveform = radar.waveform
    range_m, cell_m = echo.range_m, waveform.range_resolution_m
    if isinstance(waveform, FmcwWaveform):
        if range_m >= waveform.unambiguous_range_m:
            return "beyond the ADC's band"
        fold_m = math.inf
    elif waveform.family == "line":
        fold_m = waveform.unambiguous_range_m
    else:
        fold_m = radar.burst.unambiguous_range_m
    if range_limits_m is None:
        return range_m
    start_m, stop_m = range_limits_m[0] - cell_m, range_limits_m[1] + cell_m
    # the ambiguous range of the echo: the farthest one that is not beyond the limits
    orders = max(math.ceil((range_m - stop_m) / fold_m), 0) if math.isfinite(fold_m) else 0
    shown_m = range_m - orders * fold_m if orders else range_m
    return shown_m if start_m <= shown_m <= stop_m else "outside the range limits"


def projection_findings(frame_input: FrameInput) -> list[Finding]:
    """Return findings on powers that differ because of the projection of the receiver."""
    if not frame_input.tables or frame_input.receiver.kind != "orthographic":
        return []
    return [finding("orthographic-power")]


def predicted_snr(
    power_w: float, radar: Radar, system: RadarSystem, range_taper: str, doppler_taper: str
) -> SnrPrediction:
    """Predict the SNR in the map of a point target with some received power; see `predict_snr`.

    Only the samples that contain its echo count for the energy of the pulse.
    """
    pulse_s = coherent_samples(radar) / radar.waveform.sampling_rate_hz
    return predict_snr(
        power_w,
        pulse_s,
        radar.waveform.sampling_rate_hz,
        radar.burst.pulses * radar.slots,
        system.record.noise_figure_db,
        system.record.antenna_temperature_k,
        compression_loss_db(radar, range_taper, doppler_taper),
    )


def compression_loss_db(radar: Radar, range_taper: str, doppler_taper: str) -> float:
    """Return the SNR loss of range and Doppler taper against the matched filter [dB], 0 or more."""
    gain = map_noise_gain(radar, range_taper, doppler_taper)
    ideal = 1 / (coherent_samples(radar) * radar.burst.pulses)
    return max(10 * math.log10(gain / ideal), 0.0)


#: Powers below this fraction of the strongest are what transforms round.
_ROUNDING = 1e-14


def clutter_budget(
    expected: ExpectedPower,
    surfaces: frozenset[str],
    places: Mapping[str, tuple[ObjectEcho, float]],
    wavelength_m: float,
    noise_w: float | None,
) -> ClutterBudget | None:
    """Compare objects with the clutter in their cells; None if there is no clutter.

    `places` has the objects that the map shows, each with its range there [m]. `noise_w` is the
    mean noise of a cell.
    """
    least_w = _ROUNDING * float(expected.map.max(initial=0.0))
    clutter, error = expected.clutter_map, expected.clutter_map_error
    if clutter is None or error is None or not clutter.any():
        return None
    row, column = np.unravel_index(int(np.argmax(clutter)), clutter.shape)
    objects = {}
    for name, (echo, range_m) in places.items():
        if name in surfaces:
            continue
        cell = expected.cell(range_m, -2 * echo.range_rate_mps / wavelength_m)
        here_w = float(clutter[cell]) if clutter[cell] > least_w else 0.0
        objects[name] = CellClutter(
            here_w,
            float(error[cell]),
            ratio_db(echo.power_w, here_w),
            ratio_db(here_w, noise_w),
        )
    return ClutterBudget(
        surfaces,
        float(clutter[row, column]),
        float(expected.range_m[column]),
        float(-expected.doppler_hz[row] * wavelength_m / 2),
        noise_w,
        objects,
    )


def ratio_db(power_w: float, reference_w: float | None) -> float | None:
    """Return 10 log10 of a ratio; None where it is no finite number."""
    if not reference_w or power_w <= 0:
        return None
    return 10 * math.log10(power_w / reference_w)


def _dbm(power_w: float) -> float | None:
    return None if power_w <= 0 else 10 * math.log10(power_w) + 30


def _text(value: float | None) -> str:
    return "   -inf" if value is None else f"{value:z7.2f}"


def _range_text(range_m: float) -> str:
    """Return a range with two decimals, more below a metre."""
    digits = max(2, 2 - math.floor(math.log10(range_m))) if range_m > 0 else 2
    return f"{range_m:10.{min(digits, 9)}f}"
