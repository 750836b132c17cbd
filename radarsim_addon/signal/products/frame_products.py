# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of a frame (npz, JSON, CSV, EXR, SigMF, HDF5), one writer each, and of a coverage diagram.

The paper's four products of a frame that was measured by rings are amplitude and range, at t and at
t + delta t:

    products/frame_0001_amplitude_t0.exr      radiance L [W m^-2 sr^-1]
    products/frame_0001_range_t0.exr          one-way range, half the path's length [m]
    products/frame_0001_amplitude_t1.exr      the same at t + delta t
    products/frame_0001_range_t1.exr

Float32 EXR, one channel a ring: "ring.000", "ring.001"... Where a pixel has no echo, both are 0; no
value is NaN. Raw I/Q is a SigMF recording (sigmf.org, 1.2).
"""

from __future__ import annotations

import csv
import dataclasses
import hashlib
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
from ...atomic_files import replaced, write_arrays, write_json
from ...errors import MissingDependencyError
from ...findings import merge, to_json
from ...typed_json import file_sha256, with_digest
from ..decoding import PixelGrid, decode, pixel_grid
from ..detection import Detection, Detections
from ..echoes import Echoes, line_times_s
from ..maps import ExpectedPower, level_unit
from ..radar import Channel, Coverage, CoverageCurve, FmcwWaveform, waveform_to_dict
from ..runs import RadarFrame, write_exr
from ..spectrum import SynthesisReport
from .frame_result import FrameResult, frame_file, result_writer

if TYPE_CHECKING:
    from h5py import Group


@result_writer("npz", "_profile.npz", "_map.npz", "_expected.npz", "_spectrogram.npz")
def write_profile_and_map(result: FrameResult, folder: Path) -> list[Path]:
    """Write range profile and range-Doppler map, and the expected powers where they are known.

    ``_profile.npz`` (range_m, expected_power, coherent_range_m, coherent_power), ``_map.npz``
    (doppler_hz, velocity_mps, range_m, power [channel, Doppler, range]), ``_expected.npz`` with the
    fields of :class:`.maps.ExpectedPower` and clutter_to_noise in the cells of its map, and
    ``_spectrogram.npz`` (time_s, doppler_hz, velocity_mps, power [window, Doppler]).
    """
    profile, rd_map = result.profile, result.rd_map
    arrays = {
        "_profile.npz": {
            "range_m": profile.range_m,
            "expected_power": profile.power,
            "coherent_range_m": result.compressed.range_m,
            "coherent_power": result.compressed.mean_power,
        },
        "_map.npz": {
            "doppler_hz": rd_map.doppler_hz,
            "velocity_mps": rd_map.velocity_mps,
            "range_m": rd_map.range_m,
            "power": rd_map.power,
        },
    }
    if result.expected is not None:
        known = {**vars(result.expected), "clutter_to_noise": result.clutter_to_noise}
        arrays["_expected.npz"] = {
            name: values for name, values in known.items() if values is not None
        }
    shown = result.spectrogram
    if shown is not None:
        arrays["_spectrogram.npz"] = {
            name: getattr(shown, name) for name in ("time_s", "doppler_hz", "velocity_mps", "power")
        }
    files = []
    for ending, content in arrays.items():
        files.append(frame_file(folder, result.frame, ending))
        write_arrays(files[-1], content)
    return files


#: Ending of the file that is written last: a frame that has one is whole.
SUMMARY_ENDING = "_summary.json"
#: Largest summary that is read.
MOST_SUMMARY_BYTES = 1 << 26
_QUANTITIES = ("amplitude", "range")
_COLUMNS = (
    "height_m",
    "pattern_propagation_factor_f4",
    "relative_to_free_space",
    "flat_two_ray",
    "zone",
)
SIGMF_VERSION = "1.2.0"
_SIGN = "range rate positive = receding; Doppler = -2 v / wavelength"
#: More rows than this are not annotated one by one.
_MOST_ANNOTATIONS = 4096


@result_writer("json", SUMMARY_ENDING)
def write_summary(result: FrameResult, folder: Path) -> list[Path]:
    """Write numbers and findings of a frame as ``_summary.json``; see docs/files.md."""
    radar, received, report = result.rd_map.radar, result.received, result.echoes.report
    path = frame_file(folder, result.frame, SUMMARY_ENDING)
    strongest, median = result.rd_map.strongest_and_median
    fields = with_digest(
        {
            "frame": result.frame,
            "time_s": result.time_s,
            "options": result.options,
            "waveform": waveform_to_dict(radar.waveform),
            "burst": dataclasses.asdict(radar.burst),
            "sign_convention": _SIGN,
            "level_unit": level_unit(result.echoes.amplitude_model),
            "synthesis": None if report is None else _synthesis_record(report),
            "statistics": dataclasses.asdict(result.statistics),
            "leading_edges": [dataclasses.asdict(edge) for edge in result.edges],
            "leading_edges_left_out": result.edges_left_out,
            "moving_targets": [dataclasses.asdict(peak) for peak in result.moving_targets],
            "receiver": {
                "noise_power_w": received.noise_power_w,
                "full_scale": received.full_scale,
                "step": received.step,
                "clipped": received.clipped,
            },
            "speckle": None if result.speckle is None else dataclasses.asdict(result.speckle),
            "link_budget": result.budget.summary(),
            "findings": [to_json(found) for found in merge(result.findings)],
            "map": {
                "strongest": strongest,
                "median": median,
                "noise_power": result.map_noise_power,
            },
            "files": {file.name: file.stat().st_size for file in result.files},
            "files_sha256": {file.name: file_sha256(file) for file in result.files},
            "fingerprint": result.fingerprint,
        }
    )
    write_json(path, fields)
    return [path]


def _synthesis_record(report: SynthesisReport) -> dict[str, Any]:
    """Return the report without its times: the same frame makes the same file, whoever processes
    it.
    """
    record = dataclasses.asdict(report)
    del record["wall_s"]
    for step in record["steps"]:
        del step["cpu_s"]
    return record


@result_writer("csv", "_detections.csv", "_detections.json")
def write_csv(result: FrameResult, folder: Path) -> list[Path]:
    """Write the CFAR detections of a frame. Without CFAR, write nothing."""
    if result.detections is None:
        return []
    unit = level_unit(result.echoes.amplitude_model)
    return write_detections(frame_file(folder, result.frame, ""), result.detections, unit)


def write_detections(stem: Path, found: Detections, unit: str = "dB") -> list[Path]:
    """Write ``_detections.csv``, one target a row, and ``_detections.json``; return both paths.

    `stem` is their path up to ``_detections``, `unit` that of levels.
    """
    table, record = (stem.with_name(f"{stem.name}_detections.{end}") for end in ("csv", "json"))
    names = _columns_of(found)
    with replaced(table) as temporary, open(temporary, "w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(names)
        writer.writerows([getattr(target, name) for name in names] for target in found.targets)
    write_json(
        record,
        {
            "sign_convention": _SIGN,
            "level_unit": unit,
            **dataclasses.asdict(found),
        },
    )
    return [table, record]


def _columns_of(found: Detections) -> list[str]:
    """Return the names of what the targets have: those of an array have directions."""
    kind = type(found.targets[0]) if found.targets else Detection
    return [field.name for field in dataclasses.fields(kind)]


@result_writer("exr", *(f"_{quantity}_t{n}.exr" for quantity in _QUANTITIES for n in (0, 1)))
def write_ring_products(result: FrameResult, folder: Path) -> list[Path]:
    frame = result.source.frame
    return write_products(frame, folder) if frame.sampling_mode == "rings" else []


def write_products(frame: RadarFrame, folder: Path) -> list[Path]:
    """Write the products of one frame, two for each snapshot.

    Parameters
    ----------
    frame
        Radar frame with the sampling mode "rings".
    folder
        Existing folder.

    Returns
    -------
    list of Path
        Files written. One snapshot at a time is in memory.
    """
    written = []
    for snapshot_index in range(frame.snapshots):
        amplitude: dict[str, NDArray[np.float32]] = {}
        range_m: dict[str, NDArray[np.float32]] = {}
        grid: PixelGrid | None = None
        for ring in range(frame.rings):
            record, channels = frame.image(ring, snapshot_index)
            grid = grid or pixel_grid(record.receiver, record.width_px, record.height_px)
            decoded = decode(record, channels, grid)
            channel = f"ring.{ring:03d}"  # three digits: any reader sorts rings by number
            amplitude[channel] = decoded.radiance.astype(np.float32)
            range_m[channel] = decoded.range_m.astype(np.float32)
        for quantity, images in zip(_QUANTITIES, (amplitude, range_m), strict=True):
            written.append(frame_file(folder, frame.number, f"_{quantity}_t{snapshot_index}.exr"))
            write_exr(written[-1], images)
    return written


def write_coverage_files(found: Coverage, curve: CoverageCurve, folder: Path) -> list[Path]:
    """Write ``coverage.npz`` and ``coverage.csv`` into an existing folder; see docs/coverage.md."""
    setup = found.setup
    arrays = {
        "range_m": found.range_m,
        "height_m": found.height_m,
        "pattern_propagation_factor_f4": found.factor,
        "relative_to_free_space": found.ground_gain,
        "zone": found.zone,
        "transmitter_height_m": setup.transmitter.height_m,
        "receiver_height_m": setup.receiver.height_m,
        "wavelength_m": setup.wavelength_m,
        "polarisation": setup.polarisation,
        "ground_index": setup.ground.index,
        "ground_rms_height_m": setup.ground.rms_height_m,
        "earth_radius_m": setup.radius_m,
        "curve_range_m": curve.range_m,
    }
    whole, table = folder / "coverage.npz", folder / "coverage.csv"
    write_arrays(whole, arrays)
    columns = (found.height_m, curve.factor, curve.ground_gain, curve.two_ray, curve.zone)
    with replaced(table) as temporary, open(temporary, "w", encoding="utf-8", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(_COLUMNS)
        writer.writerows(np.stack(columns, axis=1).tolist())
    return [whole, table]


@result_writer("sigmf", ".sigmf-data", ".sigmf-meta")
def write_sigmf_recording(result: FrameResult, folder: Path) -> list[Path]:
    stem = frame_file(folder, result.frame, "")
    return write_sigmf(stem, result.echoes, f"radarsim frame {result.frame}")


def write_sigmf(stem: Path, echoes: Echoes, description: str = "") -> list[Path]:
    """Write the samples of a burst, one pulse after the other, as complex (or real) float32.

    `stem` is the path without suffix. Several channels are interleaved sample by sample, as SigMF's
    ``core:num_channels`` says. Each pulse is an annotation; the pause between pulses is not
    recorded, ``radarsim:prf_hz`` says how long it is.
    """
    data, meta = (stem.with_name(stem.name + s) for s in (".sigmf-data", ".sigmf-meta"))
    waveform = echoes.radar.waveform
    real = isinstance(waveform, FmcwWaveform) and waveform.real_adc
    samples = echoes.samples.real.astype("<f4") if real else echoes.samples.astype("<c8")
    content = np.moveaxis(samples, 0, -1).tobytes()
    with replaced(data) as temporary:
        temporary.write_bytes(content)
    write_json(meta, _metadata(echoes, real, hashlib.sha512(content).hexdigest(), description))
    return [data, meta]


def _metadata(echoes: Echoes, real: bool, digest: str, description: str) -> dict[str, Any]:
    radar = echoes.radar
    channels, rows, count = echoes.samples.shape
    starts_s = line_times_s(radar) if radar.waveform.family == "line" else echoes.slow_time_s
    annotations = [
        {
            "core:sample_start": row * count,
            "core:sample_count": count,
            "core:label": f"pulse {row}",
            "radarsim:slow_time_s": float(starts_s[row]),
        }
        for row in range(min(rows, _MOST_ANNOTATIONS))
    ]
    waveform = waveform_to_dict(radar.waveform)
    waveform.setdefault("kind", radar.waveform.kind)
    waveform.pop("samples", None)
    return {
        "global": {
            "core:datatype": "rf32_le" if real else "cf32_le",
            "core:sample_rate": radar.waveform.sampling_rate_hz,
            "core:version": SIGMF_VERSION,
            "core:num_channels": channels,
            "core:sha512": digest,
            "core:description": description,
            "core:recorder": f"radarsim {__version__}",
            "core:extensions": [{"name": "radarsim", "version": "1.0.0", "optional": True}],
            "radarsim:unit": "sqrt(W)" if echoes.amplitude_model == "radar-equation" else "B r^2",
            "radarsim:sign_convention": "exp(-j 2 pi f0 tau): Doppler = -2 v / wavelength, "
            "receding v > 0",
            "radarsim:waveform": waveform,
            "radarsim:prf_hz": radar.burst.prf_hz,
            "radarsim:pulses": radar.burst.pulses,
            "radarsim:samples_per_row": count,
            "radarsim:first_sample_s": echoes.first_sample_s,
            "radarsim:range_limits_m": list(echoes.range_limits_m),
        },
        "captures": [{"core:sample_start": 0, "core:frequency": radar.waveform.carrier_hz}],
        "annotations": annotations,
    }


# -------------------------------------------------------------------------------------------------
# All results of a frame in one HDF5 file, with units and conventions in attributes.
# -------------------------------------------------------------------------------------------------

#: Version of the layout below.
LAYOUT_VERSION = 2
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
    **dict.fromkeys(("azimuth_deg", "elevation_deg"), "degree"),
    **dict.fromkeys(("true_azimuth_deg", "true_elevation_deg"), "degree"),
    **dict.fromkeys(("x_m", "y_m", "z_m", "world_x_m", "world_y_m", "world_z_m"), "m"),
    "reflections": "1",
    "purity": "1",
    "rcs_dbsm": "dBsm",
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
        file.attrs["sign_convention"] = f"{_SIGN}; echoes exp(-j 2 pi f0 tau)"
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
    # Its place in the file must not depend on when Python frees the object: a profiler's thread, as
    # that of Dask's workers, may hold it for a while.
    data.flush()


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
    for name in _columns_of(found):
        values = [getattr(target, name) for target in found.targets]
        column = np.array([np.nan if value is None else value for value in values])
        if name == "name":
            column = np.array(values, dtype=_h5py().string_dtype())
        unit = _UNITS[name]
        if name in ("level_db", "noise_db", "surroundings_db"):
            unit = unit_of_levels
        _put(group, name, column, unit, f"{name} of each target")


def _write_uncertainty(group: Group, expected: ExpectedPower, unit: str) -> None:
    _put(group, "range_m", expected.range_m, "m", "one-way range")
    _put(group, "doppler_hz", expected.doppler_hz, "Hz", "Doppler, receding negative")
    for kind, axes in (("profile", ["range_m"]), ("map", ["doppler_hz", "range_m"])):
        for of, told in (("", "expected power"), ("clutter_", "expected power of clutter")):
            for error, text in (("", told), ("_error", f"standard error of the {told}")):
                name = f"{of}{kind}{error}"
                if getattr(expected, name) is not None:
                    _put(group, name, getattr(expected, name), unit, text, *axes)
