# SPDX-License-Identifier: GPL-3.0-or-later
"""Powers of an orthographic receiver: off by R^2, said so wherever they are printed."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import pytest

from radarsim_addon import contract
from radarsim_addon.physics.radar_equation import bistatic_power_w
from radarsim_addon.signal.detection import object_echoes
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.runs import open_run
from radarsim_addon.terminal import printable
from tests.signal import path_runs as pr

RANGE_M = 500.0
SIGMA_M2 = 4 * 0.5 * 10.0**2  # Lambert: 4 albedo A, seen at right angles


def plate_run(folder: Path, kind: str, name: str = "Plate") -> Path:
    target = pr.plate(name, (0, RANGE_M, 0), 10.0, 0.0, 0.5)
    receiver = pr.camera(pr.pose((0, 0, 0)), math.degrees(8 / RANGE_M))
    if kind == "orthographic":
        receiver = dataclasses.replace(receiver, kind=kind, left=-8, right=8, bottom=-8, top=8)
    emitter = contract.TransmitterRecord(pr.pose((0, 0, 0)), 1e6)
    rows = pr.trace([target], receiver, emitter, 200, 2)
    return pr.write_run(
        folder, rows, [name], receiver, emitter, range_limits_m=1000.0, replicates=2
    )


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_cross_sections_are_right_and_powers_are_off_by_r2(tmp_path: Path, kind: str) -> None:
    """What the finding says is so: the cross section in closed form, R^2 in the power."""
    run = open_run(plate_run(tmp_path / "run", kind))
    (echo,) = object_echoes(run.frame(1), pr.WAVEFORM.carrier_hz)
    assert echo.rcs_m2 == pytest.approx(SIGMA_M2, rel=0.02)
    wavelength_m = pr.WAVEFORM.wavelength_m
    watts = float(bistatic_power_w(1e6, SIGMA_M2, RANGE_M, RANGE_M, wavelength_m))
    factor = RANGE_M**2 if kind == "orthographic" else 1.0
    assert echo.power_w == pytest.approx(factor * watts, rel=0.02)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize(
    "noise", [[], ["--noise-figure-db", "3"], ["--link-budget", "--thermal-noise"]]
)
def test_process_says_that_powers_are_not_received_watts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, noise: list[str]
) -> None:
    folder = plate_run(tmp_path / "run", kind)
    system = tmp_path / "system.json"
    system.write_text('{"transmit_power_w": 100.0}')
    given = [f"{word}={system}" if word == "--link-budget" else word for word in noise]
    assert main(["process", str(folder), "--no-plots", *given]) == 0
    said = "[orthographic-power]" in capsys.readouterr().out
    assert said == (kind == "orthographic")
    summary = json.loads((folder / "products" / "frame_0001_summary.json").read_text())
    assert ("orthographic-power" in [item["code"] for item in summary["findings"]]) == said


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_rcs_says_it_once(tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str) -> None:
    assert main(["objects", str(plate_run(tmp_path / "run", kind))]) == 0
    assert capsys.readouterr().out.count("[orthographic-power]") == (kind == "orthographic")


def test_names_do_not_steer_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = plate_run(tmp_path / "run", "perspective", "a\x1b[31m\nb")
    assert main(["objects", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert r"a\x1b[31m\nb" in printed
    assert "\x1b" not in printed
    assert len(printed.splitlines()) == 2
    assert main(["process", str(folder), "--no-plots"]) == 0
    printed = capsys.readouterr().out
    assert r"a\x1b[31m\nb" in printed
    assert "\x1b" not in printed


def test_only_what_steers_is_escaped() -> None:
    plain = "Größe 7 % \\ 'x' \u4e2d \U0001f4e1"
    assert printable(plain) == plain
    spoilt = "\x00\t\r\x7f\x9b\u202e\u2028\ud800"
    assert printable(spoilt) == r"\x00\t\r\x7f\x9b\u202e\u2028\ud800"
