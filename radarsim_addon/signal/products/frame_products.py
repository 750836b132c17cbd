# SPDX-License-Identifier: GPL-3.0-or-later
"""Files and pictures of one processed frame."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from pathlib import Path

import numpy as np

from ...atomic_files import remove_file, write_arrays, write_json
from ..detection import FrameResult, ProcessOptions
from ..echoes import ReceivedSignal
from ..maps import ExpectedPower, level_unit
from ..radar import waveform_to_dict
from .detection_files import write_detections
from .hdf5 import write_hdf5
from .sigmf import write_sigmf

#: All that processing writes of a frame, and nobody else: see `remove_stale`.
_ENDINGS = (
    *("_amplitude_t0.exr", "_amplitude_t1.exr", "_range_t0.exr", "_range_t1.exr"),
    *("_profile.npz", "_map.npz", "_summary.json", "_expected.npz"),
    *("_detections.csv", "_detections.json", ".h5", ".sigmf-data", ".sigmf-meta"),
    *("_rings.png", "_echo.png", "_range_profile.png", "_range_doppler.png"),
)


def write_results(result: FrameResult, folder: Path, options: ProcessOptions) -> list[Path]:
    """Write profile, map, summary and what else was asked for; returns the files.

    Raises
    ------
    OutputError
        A file cannot be written.
    MissingDependencyError
        HDF5 was asked for without h5py.
    """
    stem = folder / f"frame_{result.frame:04d}"
    profile, rd_map = result.profile, result.rd_map
    unit = level_unit(result.echoes.amplitude_model)
    names = [stem.with_name(stem.name + s) for s in ("_profile.npz", "_map.npz", "_summary.json")]
    write_arrays(
        names[0],
        {
            "range_m": profile.range_m,
            "expected_power": profile.power,
            "coherent_range_m": result.compressed.range_m,
            "coherent_power": np.mean(np.abs(result.compressed.values) ** 2, axis=0),
        },
    )
    write_arrays(
        names[1],
        {
            "doppler_hz": rd_map.doppler_hz,
            "velocity_mps": rd_map.velocity_mps,
            "range_m": rd_map.range_m,
            "power": rd_map.power,
        },
    )
    write_json(
        names[2],
        {
            "frame": result.frame,
            "time_s": result.time_s,
            "options": options.record(),
            "waveform": waveform_to_dict(rd_map.radar.waveform),
            "burst": dataclasses.asdict(rd_map.radar.burst),
            "sign_convention": "range rate positive = receding; Doppler = -2 v / wavelength",
            "level_unit": unit,
            "synthesis": dataclasses.asdict(result.echoes.report) if result.echoes.report else None,
            "statistics": dataclasses.asdict(result.statistics),
            "leading_edges": [dataclasses.asdict(edge) for edge in result.edges],
            "moving_targets": [dataclasses.asdict(peak) for peak in result.moving_targets],
            "receiver": None if result.reception is None else _receiver_record(result.reception),
            "speckle": None if result.speckle is None else dataclasses.asdict(result.speckle),
            "budget": None if result.budget is None else result.budget.summary(),
            "warnings": result.warnings,
        },
    )
    if result.expected is not None:
        names.append(_write_expected(stem, result.expected))
    if result.detections is not None:
        names += write_detections(stem, result.detections, unit)
    if options.hdf5:
        names.append(write_hdf5(stem.with_name(stem.name + ".h5"), result, options))
    if options.sigmf:
        names += write_sigmf(stem, result.echoes, f"radarsim frame {result.frame}")
    return names


def remove_stale(folder: Path, frame: int, written: Collection[Path]) -> None:
    """Remove files of a frame that an earlier processing wrote and this one did not."""
    keep = {path.name for path in written}
    for ending in _ENDINGS:
        name = f"frame_{frame:04d}{ending}"
        if name not in keep:
            remove_file(folder / name)


def _receiver_record(reception: ReceivedSignal) -> dict[str, float | int | None]:
    return {
        "noise_power_w": reception.noise_power_w,
        "full_scale": reception.full_scale,
        "step": reception.step,
        "clipped": reception.clipped,
    }


def _write_expected(stem: Path, expected: ExpectedPower) -> Path:
    path = stem.with_name(stem.name + "_expected.npz")
    write_arrays(path, {f.name: getattr(expected, f.name) for f in dataclasses.fields(expected)})
    return path
