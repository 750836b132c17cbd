# SPDX-License-Identifier: GPL-3.0-or-later
"""Power budgets: antennas by name, system files, and every way in which they can be wrong."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import AntennaRecord, LinkBudget, RunRecord
from radarsim_addon.errors import ConfigError
from radarsim_addon.options import declared
from radarsim_addon.physics.antennas import direction_from_angles, sphere_mean
from radarsim_addon.signal.pipeline import main
from radarsim_addon.signal.radar import (
    cut_dbi,
    half_power_width_rad,
    make_system,
    read_system,
    self_contained,
)
from radarsim_addon.signal.radar.link_budget import PATTERNS, make_antenna
from radarsim_addon.typed_json import read_record, write_record
from tests.signal.synthetic import Setup, points, run_record, write_run

WAVELENGTH_M = 0.0565
AHEAD = np.array([0.0, 0.0, -1.0])

LOSSLESS: dict[str, dict[str, Any]] = {
    "isotropic": {},
    "cosine": {"exponent": 3.0},
    "gaussian": {"azimuth_beamwidth_deg": 20.0, "elevation_beamwidth_deg": 35.0},
    "aperture": {"width_m": 0.2, "height_m": 0.1},
    "array": {"columns": 6, "rows": 4, "steer_azimuth_deg": 10.0, "column_taper": "hamming"},
}


@pytest.mark.parametrize("kind", LOSSLESS)
def test_antennas_by_name_radiate_what_they_accept(kind: str) -> None:
    antenna = make_antenna(AntennaRecord(kind, LOSSLESS[kind]), WAVELENGTH_M)
    # Apertures of few wavelengths: the pattern's edge at 90 degrees costs the quadrature digits.
    assert sphere_mean(antenna, 361, 720) == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("kind", [kind for kind in LOSSLESS if kind not in ("isotropic", "array")])
def test_gain_dbi_sets_the_peak(kind: str) -> None:
    parameters = {**LOSSLESS[kind], "peak_gain_dbi": 5.0}
    antenna = make_antenna(AntennaRecord(kind, parameters), WAVELENGTH_M)
    assert float(antenna.gain(AHEAD)) == pytest.approx(10**0.5)


def test_beamwidth_is_the_full_width_at_half_power() -> None:
    record = AntennaRecord("cosine", {"beamwidth_deg": 30.0})
    antenna = make_antenna(record, WAVELENGTH_M)
    edge = direction_from_angles(np.radians(15.0), 0.0)
    assert float(antenna.gain(edge) / antenna.gain(AHEAD)) == pytest.approx(0.5)


def test_isotropic_elements_radiate_backwards() -> None:
    behind = -AHEAD
    for exponent, least in ((None, 0.1), (1.0, 0.0)):
        record = AntennaRecord("array", {"columns": 4, "element_exponent": exponent})
        gain = float(make_antenna(record, WAVELENGTH_M).gain(behind))
        assert gain > least if exponent is None else gain == 0


def test_a_table_is_kept_whole(tmp_path: Path) -> None:
    angles = np.arange(-180, 181, 10)
    elevations = np.arange(-90, 91, 10)
    lines = ["azimuth_deg,elevation_deg,gain_db"]
    for a in angles:
        lines += [f"{a},{e},{-abs(a) / 10 - abs(e) / 5}" for e in elevations]
    (tmp_path / "beam.csv").write_text("\n".join(lines))
    record = self_contained(AntennaRecord("table", {"file": "beam.csv"}), tmp_path)
    assert "file" not in record.parameters
    again = AntennaRecord("table", json.loads(json.dumps(record.parameters)))
    direct = make_antenna(AntennaRecord("table", {"file": str(tmp_path / "beam.csv")}), 1.0)
    rng = np.random.default_rng(1)
    directions = rng.standard_normal((500, 3))
    np.testing.assert_allclose(
        make_antenna(again, 1.0).gain(directions), direct.gain(directions), rtol=1e-12
    )


@pytest.mark.parametrize(
    ("kind", "parameters", "message"),
    [
        ("dish", {}, "dish.*expected one of isotropic"),
        ("gaussian", {"azimuth_beamwidth_deg": 10.0}, "lacks elevation_beamwidth_deg"),
        ("gaussian", {**LOSSLESS["gaussian"], "taper": "hann"}, "unknown field 'taper'"),
        ("gaussian", {**LOSSLESS["gaussian"], "peak_gain_dbi": 40.0}, "directivity of 17"),
        ("cosine", {"exponent": "3"}, "Exponent is '3'; expected a finite number"),
        ("cosine", {"exponent": 1, "beamwidth_deg": 3}, "one of them"),
        ("cosine", {"exponent": [1, 2]}, r"Exponent is \[1, 2\]; expected a finite number"),
        ("array", {"columns": 2.5}, "whole number"),
        ("array", {"columns": 4, "column_spacing_m": 1, "column_spacing_wavelengths": 1}, "one of"),
        ("table", {}, "lacks its table"),
        ("table", {"file": "nowhere.csv"}, "does not exist"),
    ],
)
def test_wrong_antennas_are_named(kind: str, parameters: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_antenna(AntennaRecord(kind, parameters), WAVELENGTH_M)


def test_system_file_round_trip(tmp_path: Path) -> None:
    record = LinkBudget(
        transmit_power_w=250.0,
        transmitter=AntennaRecord("gaussian", LOSSLESS["gaussian"]),
        receiver=AntennaRecord("array", LOSSLESS["array"]),
        transmit_loss_db=1.0,
        receive_loss_db=2.0,
        noise_figure_db=4.0,
        amplitude_model="paper",
    )
    file = tmp_path / "system.json"
    write_record(file, record)
    assert read_system(file) == record
    system = make_system(read_system(file), WAVELENGTH_M)
    assert system.loss == pytest.approx(10**0.3)
    # k T_0 F B
    assert system.noise_power_w(60e6) == pytest.approx(1.380649e-23 * 290 * 10**0.4 * 60e6)


def test_a_few_fields_will_do(tmp_path: Path) -> None:
    file = tmp_path / "system.json"
    file.write_text(
        '{"transmit_power_w": 5, "receiver": {"kind": "cosine", "parameters": {"exponent": 2}}}'
    )
    record = read_system(file)
    assert record.transmit_power_w == 5.0
    assert record.transmitter == AntennaRecord()
    assert record.receiver.kind == "cosine"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "as JSON"),
        ("[1]", "expected a JSON object"),
        ('{"power_w": 3}', "unknown field 'power_w'; its fields are transmit_power_w"),
        ('{"transmit_power_w": "3"}', "expected a finite number"),
        ('{"transmitter": {"kind": 3}}', "Pattern is 3; expected one of 'isotropic'"),
        ('{"transmitter": {"parameters": 3}}', "expected a JSON object"),
    ],
)
def test_wrong_system_files_are_named(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "system.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match=message):
        read_system(file)
    with pytest.raises(ConfigError, match="is missing"):
        read_system(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"transmit_power_w": 0.0}, "Transmit power"),
        ({"receive_loss_db": -1.0}, "Receive loss"),
        ({"noise_figure_db": float("nan")}, "Noise figure"),
        (
            {"amplitude_model": "mine"},
            "Amplitude model is 'mine'; expected one of 'radar-equation'",
        ),
        ({"transmitter": AntennaRecord("x")}, "Transmitter's antenna"),
        ({"receiver": AntennaRecord("x")}, "Receiver's antenna"),
    ],
)
def test_wrong_budgets_are_named(changes: dict, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        make_system(LinkBudget(**changes), WAVELENGTH_M)


def test_run_keeps_its_system(tmp_path: Path) -> None:
    plain = run_record(Setup())
    assert plain.link_budget is None
    system = LinkBudget(2.0, receiver=AntennaRecord("cosine", {"exponent": 1.5}))
    write_record(tmp_path / "run.json", RunRecord(**{**plain.__dict__, "link_budget": system}))
    assert read_record(tmp_path / "run.json", RunRecord).link_budget == system
    assert read_system(tmp_path / "run.json") == system


def test_every_kind_can_be_chosen() -> None:
    assert [value for value, _, _ in declared(AntennaRecord)["kind"].of.choices] == list(PATTERNS)


# -- pictures --------------------------------------------------------------------------------------


def test_cuts_go_through_the_principal_planes() -> None:
    record = AntennaRecord("gaussian", LOSSLESS["gaussian"])
    antenna = make_antenna(record, WAVELENGTH_M)
    for plane, width_deg in (("azimuth", 20.0), ("elevation", 35.0)):
        assert np.degrees(half_power_width_rad(antenna, plane)) == pytest.approx(
            width_deg, abs=0.02
        )
        half = np.radians([width_deg / 2, 0.0, -width_deg / 2])
        cut = cut_dbi(antenna, half, plane)
        np.testing.assert_allclose(cut[1] - cut, [3.0103, 0, 3.0103], atol=1e-3)
    assert half_power_width_rad(make_antenna(AntennaRecord(), 1.0), "azimuth") == 2 * np.pi


def test_antennas_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    file = tmp_path / "system.json"
    antenna = AntennaRecord("aperture", {"width_m": 0.6, "height_m": 0.3})
    write_record(file, LinkBudget(transmitter=antenna))
    assert main(["antennas", str(file)]) == 2
    assert "give --carrier-ghz" in capsys.readouterr().err
    out = tmp_path / "out"
    assert main(["antennas", str(file), "--carrier-ghz", "10", "--out", str(out)]) == 0
    # 2 asin(0.4429 lambda / W): 2.536 and 5.075 degrees
    printed = capsys.readouterr().out
    assert "beamwidth 2.54 x 5.0" in printed
    assert [path.name for path in out.iterdir()] == ["system_antennas.png"]
    assert (out / "system_antennas.png").stat().st_size > 20_000
    # left out: beside the file, or where the run's products are
    assert main(["antennas", str(file), "--carrier-ghz", "10"]) == 0
    assert (tmp_path / "system_antennas.png").is_file()
    setup = Setup()
    run = write_run(tmp_path / "run", setup, points(setup, []))
    plan = run_record(setup)
    write_record(run / "run.json", dataclasses.replace(plan, link_budget=LinkBudget()))
    assert main(["antennas", str(run)]) == 0
    assert str(run / "products" / "antennas.png") in capsys.readouterr().out
    assert (run / "products" / "antennas.png").is_file()
    assert list(elsewhere.iterdir()) == []
