# SPDX-License-Identifier: GPL-3.0-or-later
"""Profile, map and summary of a frame: ``npz`` and ``json``."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from ...atomic_files import write_arrays, write_json
from ...findings import merge, to_json
from ...sidecar import file_sha256, with_digest
from ..echoes import ReceivedSignal
from ..maps import level_unit
from ..radar import waveform_to_dict
from ..results import FrameResult, frame_file, result_writer
from ..spectrum import SynthesisReport


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


@result_writer("json", SUMMARY_ENDING)
def write_summary(result: FrameResult, folder: Path) -> list[Path]:
    """Write numbers and findings of a frame as ``_summary.json``; see docs/files.md."""
    radar, report = result.rd_map.radar, result.echoes.report
    path = frame_file(folder, result.frame, SUMMARY_ENDING)
    strongest, median = result.rd_map.strongest_and_median
    fields = with_digest(
        {
            "frame": result.frame,
            "time_s": result.time_s,
            "options": result.options,
            "waveform": waveform_to_dict(radar.waveform),
            "burst": dataclasses.asdict(radar.burst),
            "sign_convention": "range rate positive = receding; Doppler = -2 v / wavelength",
            "level_unit": level_unit(result.echoes.amplitude_model),
            "synthesis": None if report is None else _synthesis_record(report),
            "statistics": dataclasses.asdict(result.statistics),
            "leading_edges": [dataclasses.asdict(edge) for edge in result.edges],
            "leading_edges_left_out": result.edges_left_out,
            "moving_targets": [dataclasses.asdict(peak) for peak in result.moving_targets],
            "receiver": _receiver_record(result.received),
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
    """The report without its times: the same frame makes the same file, whoever processes it."""
    record = dataclasses.asdict(report)
    del record["wall_s"]
    for step in record["steps"]:
        del step["cpu_s"]
    return record


def _receiver_record(received: ReceivedSignal) -> dict[str, float | int | None]:
    return {
        "noise_power_w": received.noise_power_w,
        "full_scale": received.full_scale,
        "step": received.step,
        "clipped": received.clipped,
    }
