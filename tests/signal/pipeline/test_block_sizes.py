# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes of blocks and caches change no result; limits refuse or shorten, and say so."""

from __future__ import annotations

import importlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import AntennaRecord, LinkBudget, TransmitterRecord
from radarsim_addon.errors import ConfigError, FrameFileError
from radarsim_addon.physics.clutter import read_clutter_table
from radarsim_addon.signal import (
    Burst,
    Cfar,
    FmcwWaveform,
    FrameResult,
    ProcessOptions,
    Radar,
    process_run,
    waveform_to_dict,
)
from radarsim_addon.signal.radar import read_system
from radarsim_addon.signal.radar.radar_files import load_radar, load_samples
from tests.signal import path_runs as pr

RADARS = {
    "pulses": Radar(pr.WAVEFORM, Burst(1000.0, 32)),
    "ramps": Radar(FmcwWaveform(5.3e9, 50e6, 128, 2.5e6), Burst(1000.0, 32)),
}
#: A value that a frame of 1500 paths, 32 pulses and 65 ranges crosses.
SIZES = [
    ("detection.cfar", "_BLOCK", 64),
    ("detection.objects", "_SMALL_TILE", 1),
    ("maps.range_compression", "_PADDED", 1),
    ("maps.expected_power_map", "_MOST_CELLS", 1),
    ("maps.expected_power_map", "_SMALL_TABLE", 1),
    ("maps.range_compression", "_TOGETHER", 1),
    ("maps.expected_power_map", "_FEW_ROWS", 0),
    ("paths.footprints", "_MOST_KEPT", 1),
    ("paths.table_footprints", "_KEPT_ROWS", 1),
    ("scattering.surface_speckle", "_KEPT_ROWS", 1),
    ("spectrum.accumulator", "_BLOCKS", 1),
    ("spectrum.accumulator", "_SUMMED", 7),
    ("spectrum.all_pulses", "_LEAST_BLOCKS", 5),
    ("spectrum.all_pulses", "_MAX_GRID", 1 << 10),
    ("spectrum.all_pulses", "_MAX_TARGETS", 64),
    ("spectrum.nufft", "_MANY_CELLS", 1),
    ("spectrum.accumulator", "_MAX_LINEAR", 16),
    ("spectrum.nufft", "_FEW_TERMS", 1),
    ("spectrum.nufft", "_UNSORTED", 1),
    ("spectrum.pulse_sums", "_MOST_THREADS", 1),
    ("spectrum.transform", "BLOCK", 64),
    ("spectrum.pulse_sums", "_BLOCKS", 3),
    ("spectrum.pulse_sums", "_FEW", 1),
    ("spectrum.pulse_sums", "_MAX_LENGTHS", 64),
]


def beam(width_deg: float) -> AntennaRecord:
    widths = {"azimuth_beamwidth_deg": width_deg, "elevation_beamwidth_deg": width_deg}
    return AntennaRecord("gaussian", widths)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three plates: a stationary one, one that turns (all rates differ), one that recedes."""
    receiver, emitter = pr.camera(pr.pose((0, 0, 0))), TransmitterRecord(pr.pose((0.5, 0, 0)), 1e6)
    plates = [
        pr.plate("Near", (3, 20, 0), 4, 20),
        pr.plate("Turning", (-6, 35, 2), 6, -25),
        pr.plate("Receding", (0, 50, 4), 5, 10),
    ]
    rows = pr.trace(plates, receiver, emitter, 64, 2, seed=1)
    of = rows["last_object"]
    rows["range_rate_mps"][of == 2] = (rows["last_scatterer_m"][of == 2, 0] + 6) * 0.4
    rows["range_rate_mps"][of == 3] = 6.0
    budget = LinkBudget(1e3, beam(30.0), beam(40.0))
    return pr.write_run(
        tmp_path_factory.mktemp("blocks") / "run", rows, [p.name for p in plates], receiver,
        emitter, range_limits_m=80.0, replicates=2, system=budget,
    )  # fmt: skip


def frame_result(folder: Path, radar: Radar) -> FrameResult:
    options = ProcessOptions(
        products=False, plots=False, cfar=Cfar("os", 1e-5), radar=radar, speckle_seed=1
    )
    return next(e for e in process_run(folder, options) if isinstance(e, FrameResult))


def results(folder: Path, radar: Radar) -> dict[str, Any]:
    found = frame_result(folder, radar)
    assert found.expected is not None and found.detections is not None
    arrays = {**vars(found.expected), "samples": found.echoes.samples, "map": found.rd_map.values}
    lists = {
        "targets": [[t.range_m, t.velocity_mps] for t in found.detections.targets],
        "objects": [[o.power_w, o.power_error_w, o.rcs_m2] for o in found.budget.objects],
    }
    return {
        name: np.array(value) for name, value in {**arrays, **lists}.items() if value is not None
    }


@pytest.fixture(scope="module")
def usual(folder: Path) -> dict[str, dict[str, Any]]:
    found = {name: results(folder, radar) for name, radar in RADARS.items()}
    assert all(len(one["targets"]) >= 3 and len(one["objects"]) == 3 for one in found.values())
    return found


@pytest.mark.parametrize(("module", "name", "value"), SIZES)
def test_results_do_not_depend_on_sizes_of_blocks(
    folder: Path, usual: Any, monkeypatch: pytest.MonkeyPatch, module: str, name: str, value: int
) -> None:
    there = importlib.import_module(f"radarsim_addon.signal.{module}")
    kind = "ramps" if name == "_PADDED" else "pulses"
    assert value < getattr(there, name) or name == "_LEAST_BLOCKS"
    monkeypatch.setattr(there, name, value)
    for key, found in results(folder, RADARS[kind]).items():
        wanted = usual[kind][key]
        scale = np.abs(wanted[np.isfinite(wanted)]).max(initial=0.0)
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=3e-6 * scale, err_msg=key)


def test_lists_hold_the_strongest(
    folder: Path, usual: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim_addon.signal.detection.detections.MAX_DETECTIONS", 2)
    monkeypatch.setattr("radarsim_addon.signal.detection.moving_targets._MAX_TARGETS", 1)
    monkeypatch.setattr("radarsim_addon.signal.pipeline.frame.MAX_EDGES", 1)
    found = frame_result(folder, RADARS["pulses"])
    assert found.detections is not None
    kept = [[t.range_m, t.velocity_mps] for t in found.detections.targets]
    assert all(min(abs(usual["pulses"]["targets"] - one).sum(axis=1)) < 1e-6 for one in kept)
    assert len(kept) == 2 and found.detections.left_out == len(usual["pulses"]["targets"]) - 2
    assert len(found.moving_targets) == 1
    assert len(found.edges) == 1 and found.edges_left_out >= 1
    assert found.edges[0].peak_range_m == pytest.approx(20.0, abs=2.0)  # the nearest plate


@pytest.mark.parametrize(
    ("limit", "read", "name"),
    [
        ("physics.checks._MAX_TABLE_BYTES", read_clutter_table, "table.csv"),
        ("signal.radar.radar_files._MAX_RADAR_BYTES", load_radar, "radar.json"),
        ("signal.radar.link_budget._MAX_BYTES", read_system, "budget.json"),
        ("signal.radar.radar_files._MAX_SAMPLE_BYTES", load_samples, "wave.npy"),
    ],
)
def test_a_file_beyond_its_limit_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, read: Any, name: str
) -> None:
    """Read as it is, refused with a limit of 40 bytes."""
    radar = {"waveform": waveform_to_dict(pr.WAVEFORM), "burst": {"pulses": 4, "prf_hz": 1e3}}
    path = tmp_path / name
    if name == "table.csv":
        path.write_text("grazing_deg,sigma0_db\n1,-30\n10,-20\n90,-10\n")
    elif name == "wave.npy":
        np.save(path, np.exp(1j * np.arange(64.0)))
    else:
        given = {"radar.json": radar, "budget.json": asdict(LinkBudget(1e3))}[name]
        path.write_text(json.dumps(given))
    read(path)
    monkeypatch.setattr(f"radarsim_addon.{limit}", 40)
    with pytest.raises((ConfigError, FrameFileError), match=name):
        read(path)
