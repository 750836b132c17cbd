# SPDX-License-Identifier: GPL-3.0-or-later
"""The power budget as a stage of processing: gains on paths, objects with their RCS and SNR."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

from ..contract import SystemRecord
from ..physics.noise import SnrPrediction, predict_snr
from .config import Radar
from .frames import RadarFrame
from .link import Link, frame_antennas
from .noisefloor import coherent_samples, map_noise_gain
from .objects import ObjectEcho, object_echoes
from .paths import Paths
from .system import RadarSystem, make_system

#: Share of a frame's power in paths of unknown last vertex that is worth a warning.
_GUESSED_SHARE = 1e-3
#: Objects whose share of the strongest one's power is below this are rounding [dB].
_LEAST_DB = -200.0


def compression_loss_db(radar: Radar, window: str, doppler_window: str) -> float:
    """SNR that the windows over band and pulses cost against the matched filter [dB], 0 or more.

    Both from the noise that comes through: see :mod:`.noisefloor`.
    """
    gain = map_noise_gain(radar, window, doppler_window)
    ideal = 1 / (coherent_samples(radar) * radar.burst.pulses)
    return max(10 * math.log10(gain / ideal), 0.0)


def predicted_snr(
    power_w: float, radar: Radar, system: RadarSystem, window: str, doppler_window: str
) -> SnrPrediction:
    """What the map shows of a point target of this received power; see `predict_snr`.

    The energy of the pulse as it is sampled: as many samples as carry its echo.
    """
    pulse_s = coherent_samples(radar) / radar.waveform.sampling_rate_hz
    return predict_snr(
        power_w,
        pulse_s,
        radar.waveform.sampling_rate_hz,
        radar.burst.pulses,
        system.record.noise_figure_db,
        system.record.antenna_temperature_k,
        compression_loss_db(radar, window, doppler_window),
    )


@dataclass(frozen=True)
class BudgetReport:
    """Power budget of a frame.

    Attributes
    ----------
    received_w
        All paths together [W].
    noise_w
        Thermal noise of one complex sample at the receiver's input; None without a system [W].
    objects
        Objects that echo, the strongest first; none for rings.
    snr
        By the object's name, where there is a system.
    warnings
        In whole sentences.
    """

    received_w: float
    noise_w: float | None
    objects: list[ObjectEcho] = field(default_factory=list)
    snr: dict[str, SnrPrediction] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def summary(self) -> dict[str, Any]:
        """For ``_summary.json``: powers in W and dBm, cross sections in m^2 and dBsm."""
        return {
            "received_w": self.received_w,
            "received_dbm": _dbm(self.received_w),
            "noise_w": self.noise_w,
            "noise_dbm": None if self.noise_w is None else _dbm(self.noise_w),
            "objects": [
                {
                    **dataclasses.asdict(echo),
                    "power_dbm": _dbm(echo.power_w),
                    "rcs_dbsm": _db(echo.rcs_m2),
                    "predicted_snr": dataclasses.asdict(self.snr[echo.name])
                    if echo.name in self.snr
                    else None,
                }
                for echo in self.objects
            ],
        }

    def lines(self) -> list[str]:
        """For people, one object a line."""
        found = []
        if self.noise_w is not None:
            found.append(
                f"received {_text(_dbm(self.received_w))} dBm in all, noise "
                f"{_text(_dbm(self.noise_w))} dBm a sample"
            )
        for echo in self.objects:
            line = (
                f"{echo.name:20.20} {echo.range_m:10.2f} m   {_text(_dbm(echo.power_w))} dBm   "
                f"RCS {_text(_db(echo.rcs_m2))} dBsm"
            )
            if echo.power_error_w is not None and echo.power_w > 0:
                line += f" +- {100 * echo.power_error_w / echo.power_w:.2g} %"
            if echo.name in self.snr:
                line += f"   SNR in the map {self.snr[echo.name].burst_db:.1f} dB (as a point)"
            found.append(line)
        return found


class FrameBudget:
    """Applies a power budget to the paths of a frame as they stream by.

    Parameters
    ----------
    frame
        Radar frame.
    radar
        Waveform and burst.
    record
        Power budget; None: paths stay as they are.

    Raises
    ------
    ConfigError
        The budget cannot be used.
    FrameFileError, SchemaError
        The frame's sidecars are missing or damaged.
    """

    def __init__(self, frame: RadarFrame, radar: Radar, record: SystemRecord | None) -> None:
        self._frame, self._radar = frame, radar
        self.system: RadarSystem | None = None
        self.link: Link | None = None
        if record is not None:
            self.system = make_system(record, radar.waveform.wavelength_m)
            antennas = frame_antennas(frame.path, frame.number, frame.acquisition)
            self.link = Link(self.system, *antennas)

    def apply(self, paths: Paths) -> Paths:
        """The paths with the system's gains."""
        return paths if self.link is None else self.link.apply(paths)

    def report(
        self, received_w: float, window: str = "hamming", doppler_window: str = "hamming"
    ) -> BudgetReport:
        """Objects, noise and predictions, after all paths were seen.

        Parameters
        ----------
        received_w
            Sum of the paths' powers [W].
        window, doppler_window
            Over band and pulses, for the predicted SNR.
        """
        radar, system = self._radar, self.system
        objects: list[ObjectEcho] = []
        if self._frame.acquisition == "paths":
            objects = object_echoes(self._frame, radar.waveform.carrier_hz, self.link)
            least = 10 ** (_LEAST_DB / 10) * max((echo.power_w for echo in objects), default=0.0)
            objects = [echo for echo in objects if echo.power_w > least]
        noise_w = None
        snr = {}
        if system is not None:
            noise_w = system.noise_power_w(radar.waveform.sampling_rate_hz)
            if noise_w > 0:
                snr = {
                    echo.name: predicted_snr(echo.power_w, radar, system, window, doppler_window)
                    for echo in objects
                }
        return BudgetReport(received_w, noise_w, objects, snr, self._warnings())

    def _warnings(self) -> list[str]:
        link = self.link
        if link is None or link.seen_w == 0 or link.guessed_w < _GUESSED_SHARE * link.seen_w:
            return []
        share = 100 * link.guessed_w / link.seen_w
        text = (
            f"{share:.2g} % of the power is in {link.guessed} paths whose last scatterer is "
            "unknown; the transmit gain is taken where a single reflection would lie. Measure by "
            "paths, or rings without bounces, to be rid of it."
        )
        return [text]


def _dbm(power_w: float) -> float | None:
    return None if power_w <= 0 else 10 * math.log10(power_w) + 30


def _db(value: float) -> float | None:
    return None if value <= 0 else 10 * math.log10(value)


def _text(value: float | None) -> str:
    return "   -inf" if value is None else f"{value:7.2f}"
