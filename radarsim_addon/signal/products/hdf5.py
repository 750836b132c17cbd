# SPDX-License-Identifier: GPL-3.0-or-later
"""All results of a frame in one HDF5 file, with units and conventions in attributes."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import json
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ... import __version__
from ...atomic_files import replaced
from ...errors import MissingDependencyError
from ...findings import merge, to_json
from ..detection import Detection, Detections
from ..echoes import line_times_s
from ..maps import ExpectedPower, level_unit
from ..radar import Channel, waveform_to_dict
from ..results import FrameResult, frame_file, result_writer

if TYPE_CHECKING:
    from h5py import Group

#: Version of the layout below.
LAYOUT_VERSION = 2
_SIGN = "range rate positive = receding; Doppler = -2 v / wavelength; echoes exp(-j 2 pi f0 tau)"
#: The scale of all channel axes.
_CHANNEL = "/channels/number"
_UNITS = {
    "range_m": "m",
    "velocity_mps": "m/s",
    "doppler_hz": "Hz",
    "level_db": "dB",  # dBW where powers are watts, see `level_unit`
    "noise_db": "dB",
    "snr_db": "dB",
    "surroundings_db": "dB",
    "unfolded_velocity_mps": "m/s",
    "row": "1",
    "col": "1",
    "name": "1",
}


def _h5py() -> ModuleType:
    if importlib.util.find_spec("h5py") is None:
        raise MissingDependencyError(
            "h5py is not installed in Blender's Python; it writes HDF5. Process the run outside "
            "Blender with 'radarsim process DIR', or write no HDF5."
        )
    return importlib.import_module("h5py")


@result_writer("hdf5", ".h5")
def write_hdf5(result: FrameResult, folder: Path) -> list[Path]:
    """Write all results of a frame into one HDF5 file.

    Groups: ``channels`` (number, transmitter_position_m, receiver_position_m, start_offset_s),
    ``echoes`` (samples [channel, pulse, sample], fast_time_s, slow_time_s), ``profile`` (range_m,
    expected_power, coherent_range_m, coherent_power [channel, range]), ``map`` (values [channel,
    Doppler, range] complex, doppler_hz, velocity_mps, range_m), ``detections`` (one column each,
    of channel 0), ``uncertainty`` (profile and map of expected power with standard errors). Every
    dataset has the attributes ``units`` and ``description``; axes are HDF5 dimension scales.
    """
    h5py, path = _h5py(), frame_file(folder, result.frame, ".h5")
    with replaced(path) as temporary, h5py.File(temporary, "w", track_order=True) as file:
        radar = result.rd_map.radar
        file.attrs["title"] = f"radarsim frame {result.frame}"
        file.attrs["software"] = f"radarsim {__version__}"
        file.attrs["layout_version"] = LAYOUT_VERSION
        file.attrs["frame"] = result.frame
        file.attrs["time_s"] = result.time_s
        file.attrs["sign_convention"] = _SIGN
        file.attrs["range_convention"] = "one-way range = half the length of the path"
        file.attrs["waveform"] = json.dumps(waveform_to_dict(radar.waveform))
        file.attrs["prf_hz"] = radar.burst.prf_hz
        file.attrs["pulses"] = radar.burst.pulses
        file.attrs["options"] = json.dumps(result.options)
        file.attrs["findings"] = json.dumps([to_json(item) for item in merge(result.findings)])
        _write_channels(file.create_group("channels"), radar.channels)
        _write_echoes(file.create_group("echoes"), result)
        _write_profile(file.create_group("profile"), result)
        _write_map(file.create_group("map"), result)
        if result.detections is not None:
            _write_detections(
                file.create_group("detections"),
                result.detections,
                level_unit(result.echoes.amplitude_model),
            )
        if result.expected is not None:
            _write_uncertainty(
                file.create_group("uncertainty"), result.expected, _unit(result, True)
            )
    return [path]


def _put(
    group: Group, name: str, values: NDArray[Any], units: str, description: str, *axes: str
) -> None:
    """Write one dataset; `axes` name datasets of the group, or of the file, that are its scales."""
    packed = {"compression": "gzip", "compression_opts": 1} if values.size > 4096 else {}
    data = group.create_dataset(name, data=values, **packed)
    data.attrs["units"], data.attrs["description"] = units, description
    for number, axis in enumerate(axes):
        if not group[axis].is_scale:
            group[axis].make_scale(axis)
        data.dims[number].attach_scale(group[axis])


def _write_channels(group: Group, channels: Sequence[Channel]) -> None:
    _put(group, "number", np.arange(len(channels)), "1", "number of the channel, from 0")
    for name, places in (
        ("transmitter_position_m", [channel.tx.position_m for channel in channels]),
        ("receiver_position_m", [channel.rx.position_m for channel in channels]),
    ):
        _put(group, name, np.array(places), "m", "phase centre in the antenna's axes")
    offsets = np.array([channel.start_offset_s for channel in channels])
    _put(group, "start_offset_s", offsets, "s", "start of the channel's pulses after the burst's")


def _unit(result: FrameResult, power: bool) -> str:
    if result.echoes.amplitude_model == "radar-equation":
        return "W" if power else "sqrt(W)"
    return "(B r^2)^2" if power else "B r^2"


def _write_echoes(group: Group, result: FrameResult) -> None:
    echoes = result.echoes
    line = echoes.radar.waveform.family == "line"
    slow_s = line_times_s(echoes.radar) if line else echoes.slow_time_s
    since = "the pulse began" if line else "the middle of the transmitted pulse"
    _put(group, "fast_time_s", echoes.fast_time_s, "s", f"time of the samples since {since}")
    _put(group, "slow_time_s", slow_s, "s", "time of the rows since the frame's time")
    _put(group, "samples", echoes.samples, _unit(result, False), "raw I/Q, carrier taken off",
         _CHANNEL, "slow_time_s", "fast_time_s")  # fmt: skip
    group.attrs["noise_power_w"] = result.received.noise_power_w
    group.attrs["clipped"] = result.received.clipped
    if result.received.step is not None:
        group.attrs["adc_step"] = result.received.step


def _write_profile(group: Group, result: FrameResult) -> None:
    power = result.compressed.mean_power
    unit = _unit(result, True)
    group.attrs["range_taper"] = result.compressed.range_taper
    _put(group, "range_m", result.profile.range_m, "m", "one-way range")
    _put(group, "expected_power", result.profile.power, unit, "without speckle and noise",
         "range_m")  # fmt: skip
    _put(group, "coherent_range_m", result.compressed.range_m, "m", "one-way range")
    _put(group, "coherent_power", power, unit, "mean of the pulses", _CHANNEL,
         "coherent_range_m")  # fmt: skip


def _write_map(group: Group, result: FrameResult) -> None:
    rd_map = result.rd_map
    group.attrs["range_taper"] = rd_map.range_taper
    group.attrs["doppler_taper"] = rd_map.doppler_taper
    _put(group, "doppler_hz", rd_map.doppler_hz, "Hz", "Doppler, receding negative")
    _put(group, "velocity_mps", rd_map.velocity_mps, "m/s", "range rate, receding positive")
    _put(group, "range_m", rd_map.range_m, "m", "one-way range")
    _put(group, "values", rd_map.values, _unit(result, False),
         "complex map; a path of power P peaks at |.|^2 = P",
         _CHANNEL, "doppler_hz", "range_m")  # fmt: skip


def _write_detections(group: Group, found: Detections, unit_of_levels: str) -> None:
    for name, value in dataclasses.asdict(found.cfar).items():
        group.attrs[f"cfar_{name}"] = value
    group.attrs["cells_above_threshold"] = found.cells
    group.attrs["independent_training_cells"] = found.independent_cells
    for field in dataclasses.fields(Detection):
        values = [getattr(target, field.name) for target in found.targets]
        column = np.array([np.nan if value is None else value for value in values])
        if field.name == "name":
            column = np.array(values, dtype=_h5py().string_dtype())
        unit = _UNITS[field.name]
        if field.name in ("level_db", "noise_db", "surroundings_db"):
            unit = unit_of_levels
        _put(group, field.name, column, unit, f"{field.name} of each target")


def _write_uncertainty(group: Group, expected: ExpectedPower, unit: str) -> None:
    _put(group, "range_m", expected.range_m, "m", "one-way range")
    _put(group, "doppler_hz", expected.doppler_hz, "Hz", "Doppler, receding negative")
    for kind, axes in (("profile", ["range_m"]), ("map", ["doppler_hz", "range_m"])):
        for of, told in (("", "expected power"), ("clutter_", "expected power of clutter")):
            for error, text in (("", told), ("_error", f"standard error of the {told}")):
                name = f"{of}{kind}{error}"
                if getattr(expected, name) is not None:
                    _put(group, name, getattr(expected, name), unit, text, *axes)
