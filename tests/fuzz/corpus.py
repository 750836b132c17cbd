# SPDX-License-Identifier: GPL-3.0-or-later
"""Small valid inputs of every kind, which the fuzzer changes."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon import contract
from radarsim_addon.contract import MotionRecord
from radarsim_addon.signal.motion import (
    BodyMotion,
    Tracks,
    VertexSeries,
    body_record,
    write_tracks,
)
from radarsim_addon.signal.radar import waveform_to_dict
from radarsim_addon.typed_json import file_sha256, read_record, with_digest, write_record
from tests.signal import path_runs, synthetic
from tests.signal.waveform_kinds import ALL

SPAN_S = 0.1
IDENTITY = np.eye(4)


def make_corpus(folder: Path) -> None:
    """Folders of runs, rings and paths; and the files that options name."""
    _rings(folder / "rings")
    _paths(folder / "paths")
    _files(folder / "files")


def _rings(folder: Path) -> None:
    setup = synthetic.Setup(frames=(1, 32), rings=2, width_px=6, height_px=5)
    echoes = [(1, 1, 300.0, 10.0, 2.0), (2, 2, 400.0, -7.0, 1.0), (3, 3, 123.4, 0.0, 1.0)]
    synthetic.write_run(folder, setup, synthetic.points(setup, echoes))
    truth = contract.ObjectRecord("Plate", 299.0, 300.0, 10.0, ["Metal"], ["Collection"])
    path = folder / contract.frame_dir(1) / contract.GROUND_TRUTH_FILE
    write_record(path, contract.GroundTruthRecord(1, 1 / 24, [truth]))


def _paths(folder: Path) -> None:
    receiver = path_runs.camera(path_runs.pose((0, 0, 0)))
    emitter = contract.TransmitterRecord(path_runs.pose((0, 0, 0)), 1.0)
    plates = [path_runs.plate("Near", (0, 20, 0), 4.0), path_runs.plate("Far", (3, 50, 0), 9.0)]
    rows = path_runs.trace(plates, receiver, emitter, 24, replicates=2)
    rows["last_body"] = rows["first_body"] = rows["last_object"]
    rows["last_surface_point"][:1] = rows["first_surface_point"][:1] = 1
    beamwidths = ("azimuth_beamwidth_deg", "elevation_beamwidth_deg")
    system = contract.LinkBudget(
        10.0,
        contract.AntennaRecord("gaussian", dict.fromkeys(beamwidths, 20.0)),
        contract.AntennaRecord("array", {"columns": 4, "rows": 2}),
    )  # fmt: skip
    names = [item.name for item in plates]
    path_runs.write_run(
        folder, rows, names, receiver, emitter, range_limits_m=80.0, system=system, replicates=2
    )
    frame = folder / contract.frame_dir(1)
    series = np.zeros((1, 2, 3, 3))
    series[0, 0] = [(0, -1, 0), (1, -1, 0), (0, -1, 1)]
    series[0, 1, :, 1] = 0.01
    vertices = np.array([[0, 1, 2]], np.int32)
    body = int(rows["last_body"][0])
    tracks = Tracks(
        np.array([body], np.int32), vertices, np.array([[0.5, 0.25, 0.25]]),
        {body: VertexSeries(np.array([0.0, SPAN_S]), series)},
    )  # fmt: skip
    still = BodyMotion(IDENTITY)
    motion = MotionRecord(
        frame=1, time_s=0.0, duration_s=SPAN_S, samples=17, receiver_kind="perspective",
        antennas=[body_record("C", "", still, False), body_record("T", "", still, False)],
        bodies=[body_record(name, "", still, name == names[body - 1]) for name in names],
        displacement_error_bound_m=0.0, displacement_error_bound_wavelengths=0.0,
        approximated_motion_fraction=0.0, unknown_motion_fraction=0.0,
        deforming_surfaces_file=contract.DEFORMING_SURFACES_FILE,
        deforming_surfaces_sha256=file_sha256(write_tracks(frame, tracks)),
    )  # fmt: skip
    write_record(frame / contract.MOTION_FILE, motion)
    record = read_record(frame / contract.PATHS_FILE, contract.PathsRecord)
    record = dataclasses.replace(record, motion_file=contract.MOTION_FILE)
    write_record(frame / contract.PATHS_FILE, record)
    correct_hashes(folder)


def _files(folder: Path) -> None:
    folder.mkdir()
    burst = {"pulses": 8, "prf_hz": 100.0}
    for waveform in ALL:
        data = {"waveform": waveform_to_dict(waveform), "burst": burst}
        kind = getattr(type(waveform), "kind", "")
        (folder / f"radar_{kind}.json").write_text(json.dumps(data))
    np.save(folder / "samples.npy", np.exp(1j * np.linspace(0, 30, 64) ** 2))
    (folder / "samples.csv").write_text("real,imaginary\n1,0\n0,1\n-1,0\n0.5,0.5\n")
    for kind in ("npy", "csv"):
        pulse = {
            "kind": "arbitrary",
            "carrier_hz": 5.3e9,
            "sampling_rate_hz": 60e6,
            "file": f"samples.{kind}",
        }
        data = {"waveform": pulse, "burst": burst}
        (folder / f"radar_{kind}.json").write_text(json.dumps(data))
    rows = [f"{a},{e},{-abs(a) / 5}" for a in range(-90, 91, 30) for e in range(-45, 46, 15)]
    (folder / "pattern.csv").write_text("azimuth_deg,elevation_deg,gain_db\n" + "\n".join(rows))
    cuts = [f"{c},{a},{-abs(a) / 5}" for c in ("azimuth", "elevation") for a in range(-90, 91, 15)]
    (folder / "cuts.csv").write_text("cut,angle_deg,gain_db\n" + "\n".join(cuts))
    (folder / "noise.csv").write_text("offset_hz,level_dbc_hz\n100,-60\n1000,-80\n100000,-110\n")
    system = {
        "transmit_power_w": 5.0,
        "noise_figure_db": 4.0,
        "transmitter": {"kind": "table", "parameters": {"file": "pattern.csv"}},
        "receiver": {"kind": "table", "parameters": {"file": "cuts.csv"}},
    }
    (folder / "link_budget.json").write_text(json.dumps(system))


def correct_hashes(run: Path) -> None:
    """Write the digests of changed files into the sidecars, as far as these can be read."""
    for path in run.rglob("*.json"):
        try:
            data = json.loads(path.read_text("utf-8"))
            for file, digest in (
                ("exr_file", "exr_sha256"),
                ("deforming_surfaces_file", "deforming_surfaces_sha256"),
            ):
                if data.get(file):
                    data[digest] = file_sha256(path.with_name(data[file]))
                    path.write_text(json.dumps(_with_own_digest(data)))
        except (OSError, ValueError, TypeError, AttributeError, RecursionError):
            continue
    for path in run.rglob(contract.PATHS_FILE):
        try:
            data = json.loads(path.read_text("utf-8"))
            if "motion_sha256" in data and path.with_name(contract.MOTION_FILE).exists():
                data["motion_sha256"] = file_sha256(path.with_name(contract.MOTION_FILE))
            with (
                contextlib.suppress(ValueError, zipfile.BadZipFile),
                np.load(path.with_name(contract.PATHS_TABLE)) as columns,
            ):
                data["column_sha256"] = {
                    name: hashlib.sha256(columns[name].tobytes()).hexdigest()
                    for name in columns.files
                }
            path.write_text(json.dumps(_with_own_digest(data)))
        except (OSError, ValueError, TypeError, AttributeError, RecursionError):
            continue


def _with_own_digest(data: dict[str, Any]) -> dict[str, Any]:
    return with_digest(data) if data.pop("record_sha256", None) else data
