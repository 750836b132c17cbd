# SPDX-License-Identifier: GPL-3.0-or-later
"""Changed inputs end in a result or in a named error; dangers that are known, one by one."""

from __future__ import annotations

import json
import random
import re
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib import format as npy_format

resource = pytest.importorskip("resource", reason="processes of POSIX")

from radarsim_addon import contract
from radarsim_addon.errors import RadarSimError
from radarsim_addon.signal import open_run
from radarsim_addon.signal.paths import PathFlag
from radarsim_addon.signal.pipeline import cli, main
from radarsim_addon.signal.radar import load_radar
from tests.fuzz import cases
from tests.fuzz.cases import run_case
from tests.fuzz.corpus import correct_hashes, make_corpus
from tests.fuzz.mutations import change_file

pytestmark = pytest.mark.slow

CASES, SEED = 100, 2


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    make_corpus(folder / "corpus")
    return folder


@pytest.fixture
def run(inputs: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(inputs / "corpus" / "paths", tmp_path / "run"))


def test_the_inputs_are_valid_before_they_are_changed(inputs: Path) -> None:
    files = inputs / "corpus" / "files"
    for name in ("rings", "paths"):
        folder = shutil.copytree(inputs / "corpus" / name, inputs / "valid" / name)
        assert main(["process", str(folder), "--no-plots"]) == 0
        assert main(["info", str(folder)]) == 0
    for radar in files.glob("radar_*.json"):
        words = ["--waveform", str(radar), "--link-budget", str(files / "link_budget.json")]
        words += ["--no-plots"]
        if "pmcw" not in radar.name:  # which takes too many samples for phase noise
            words += ["--phase-noise", str(files / "noise.csv")]
        assert main(["process", str(inputs / "valid" / "paths"), *words]) == 0


def test_changed_inputs(inputs: Path) -> None:
    """If one fails: python -m tests.fuzz --seed 2 --only NUMBER."""
    ends = {number: run_case(inputs, SEED, number) for number in range(CASES)}
    assert {number: case.fault for number, case in ends.items() if case.fault} == {}
    codes = [case.code for case in ends.values()]
    assert min(codes.count(code) for code in (0, 1, 2)) > CASES // 20


@pytest.mark.parametrize("kind", ["npy", "csv"])
def test_changed_samples(inputs: Path, tmp_path: Path, kind: str) -> None:
    """Many changes of one file: a case of the fuzzer seldom meets it."""
    files, refused = inputs / "corpus" / "files", 0
    shutil.copy(files / f"radar_{kind}.json", tmp_path)
    for number in range(300):
        shutil.copy(files / f"samples.{kind}", tmp_path)
        change_file(random.Random(number), tmp_path / f"samples.{kind}", tmp_path)
        try:
            load_radar(tmp_path / f"radar_{kind}.json")
        except RadarSimError:
            refused += 1
    assert 50 < refused < 290


def test_no_file_elsewhere_is_changed(inputs: Path, tmp_path: Path) -> None:
    """Also where a word of the command line, or a link, leads there."""
    place = Path(shutil.copytree(inputs / "corpus", tmp_path / "case"))
    shutil.copytree(place / "paths", place / "run")
    precious = tmp_path / "precious.json"
    precious.write_text("[1, 2, 3]")
    words = ["process", str(precious), "../precious.json", "precious.json"]
    for number in range(200):
        cases._change(random.Random(number), place, words)
    assert precious.read_text() == "[1, 2, 3]"
    (place / "link.json").symlink_to(precious)
    for path in (precious, place / "link.json", place / ".." / "precious.json"):
        with pytest.raises(ValueError, match="is not in"):
            change_file(random.Random(0), path, place)
    assert precious.read_text() == "[1, 2, 3]"


def test_a_fault_is_seen(inputs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(words: list[str]) -> int:
        raise ZeroDivisionError

    monkeypatch.setattr("tests.fuzz.cases.main", fails)
    monkeypatch.setattr("tests.fuzz.cases._render_arguments", fails)
    assert {run_case(inputs, SEED, number).fault for number in range(5)} == {"traceback"}


@pytest.mark.parametrize(
    ("file", "place", "value", "message"),
    [
        ("run.json", ["rings"], 10**9, "rings is 1000000000; expected a whole number from 1"),
        ("run.json", ["burst", "pulses"], 8e9, "Pulses is 8000000000; expected"),
        ("run.json", ["burst", "pulses"], 10**400, "Pulses is 10+; expected a whole number"),
        ("run.json", ["width_px"], 10**9, "width_px is 1000000000"),
        ("run.json", ["sampling_mode"], "x" * 1_000_000, "sampling mode 'xxx"),
        ("run.json", ["x" * 1_000_000], 1, ""),
        ("run.json", ["visibility_updates"], 10**12, "visibility_updates is 1000000000000"),
        ("paths.json", ["receiver", "matrix_world"], [[1.0]], "no matrix of 4 x 4"),
        ("paths.json", ["receiver", "matrix_world", 0, 3], 1e200, "matrix_world.* is 1e.200"),
        ("paths.json", ["carrier_hz"], 0, "carrier_hz is 0"),
        ("motion.json", ["bodies", 0, "pose"], [[1.0] * 4] * 3, "no matrix of 4 x 4"),
        ("motion.json", ["bodies", 0, "pose"], [[1.0], [1.0, 2.0]], "rows of one length"),
    ],
)
def test_numbers_beyond_any_scene(
    run: Path,
    capsys: pytest.CaptureFixture[str],
    file: str,
    place: list[Any],
    value: Any,
    message: str,
) -> None:
    path = next(run.rglob(file))
    data = json.loads(path.read_text("utf-8"))
    owner = data
    for key in place[:-1]:
        owner = owner[key]
    owner[place[-1]] = value
    path.write_text(json.dumps(data), encoding="utf-8")
    correct_hashes(run)
    code = main(["process", str(run), "--no-plots"])
    said = capsys.readouterr().err
    assert len(said) < 5000
    assert code == 0 if not message else code in (1, 2)
    assert re.search(message, said)


@pytest.mark.parametrize("value", [1e308, -1e308, 1e200, np.inf, np.nan])
def test_lengths_that_overflow(run: Path, capsys: pytest.CaptureFixture[str], value: float) -> None:
    """Such numbers ended the process inside the non-uniform transform."""
    path = run / contract.frame_dir(1) / contract.PATHS_TABLE
    rows = dict(np.load(path))
    rows["length_m"][3] = value
    np.savez(path, **rows)  # type: ignore[arg-type]
    correct_hashes(run)
    assert main(["process", str(run), "--no-plots"]) == 1
    assert re.search(r"row 3 has length_m .*; expected numbers from 0", capsys.readouterr().err)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("solid_angle_sr", -1.0), ("solid_angle_sr", 0.0), ("solid_angle_sr", np.nan),
        ("range_rate_mps", 1e308), ("range_rate_mps", -np.inf), ("power_w", 1e308),
        ("length_sigma_m", -1.0), ("length_m", -3.0), ("first_scatterer_m", 1e200),
        ("last_scatterer_m", -np.inf), ("direction", 2.0), ("direction", np.nan),
    ],
)  # fmt: skip
def test_quantities_of_a_row_that_cannot_be(
    run: Path, capsys: pytest.CaptureFixture[str], column: str, value: float
) -> None:
    """A solid angle of -1 sr was processed, with a warning of numpy and other numbers."""
    path = run / contract.frame_dir(1) / contract.PATHS_TABLE
    rows = dict(np.load(path))
    rows[column][7] = value
    np.savez(path, **rows)  # type: ignore[arg-type]
    correct_hashes(run)
    assert main(["process", str(run), "--no-plots"]) == 1
    said = capsys.readouterr().err
    assert f"PathDataError: {path}: row 7 has {column}" in said and "RuntimeWarning" not in said


def test_rows_without_a_length_may_have_none(run: Path) -> None:
    path = run / contract.frame_dir(1) / contract.PATHS_TABLE
    rows = dict(np.load(path))
    rows["first_scatterer_m"][8] = rows["length_m"][8] = np.nan
    rows["flags"][8] |= PathFlag.NO_RANGE
    np.savez(path, **rows)  # type: ignore[arg-type]
    correct_hashes(run)
    assert main(["process", str(run), "--no-plots"]) == 0


def test_an_archive_that_unpacks_to_gigabytes(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """4 GiB of zeros in a file of 19 MB were read; here 1 GiB."""
    path = run / contract.frame_dir(1) / contract.DEFORMING_SURFACES_FILE
    with np.load(path) as archive:
        arrays = dict(archive)
    count = 2**30 // 144
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                if name != "series_1":
                    npy_format.write_array(stream, array)
                    continue
                header = {"descr": "<f8", "fortran_order": False, "shape": (1, 2, 3 * count, 3)}
                npy_format.write_array_header_1_0(stream, header)
                for _ in range(count // 1000):
                    stream.write(bytes(144_000))
                stream.write(bytes(144 * (count % 1000)))
    for _ in range(2):  # of the surfaces, then of the record that names them
        correct_hashes(run)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert main(["process", str(run), "--no-plots"]) == 1
    said = capsys.readouterr().err
    assert re.search(r"holds 1073\d+ bytes when uncompressed, .* at most 268435456", said)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--range-limits", "0:9e18"], "argument --range-limits: 9e18 m is out of bounds"),
        (["--range-limits", "0:9e14"], "takes 128 rows of .* samples"),
        (["--noise-figure-db=-1"], "argument --noise-figure-db: -1 dB is out of bounds; .* 0 to"),
    ],
)
def test_sizes_are_refused_before_anything_is_computed(
    inputs: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    try:
        code = main(["process", str(inputs / "corpus" / "rings"), "--no-plots", *words])
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 2 and re.search(message, capsys.readouterr().err)


def test_motion_beyond_sense(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Speeds of 1e21 m/s asked for as many nodes within a pulse."""
    frame = run / contract.frame_dir(1)
    with np.load(frame / contract.DEFORMING_SURFACES_FILE) as archive:
        arrays = dict(archive)
    arrays["series_1"][0, 1, 2, 2] = 2.0**64
    np.savez(frame / contract.DEFORMING_SURFACES_FILE, **arrays)
    for _ in range(2):  # of the surfaces, then of the record that names them
        correct_hashes(run)
    assert main(["process", str(run), "--no-plots"]) == 2
    assert "rad within a pulse; at most" in capsys.readouterr().err


def test_a_full_memory_is_said(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """80 000 pulses of a changed radar file took 500 MiB for each array of the map."""

    def full(*_: Any, **__: Any) -> Any:
        return np.empty(2**55, dtype=np.complex128)

    monkeypatch.setattr(cli, "process_run", full)
    assert main(["process", str(run), "--no-plots"]) == 1
    assert re.search(r"Unable to allocate .*\. Take fewer pulses", capsys.readouterr().err)


@pytest.mark.parametrize("count", [2**33, 2**62])
def test_headers_that_claim_more_than_the_file_holds(
    inputs: Path, tmp_path: Path, count: int
) -> None:
    for name in ("samples.npy", "radar_npy.json"):
        shutil.copy(inputs / "corpus" / "files" / name, tmp_path / name)
    with open(tmp_path / "samples.npy", "wb") as stream:
        header = {"descr": "<c16", "fortran_order": False, "shape": (count,)}
        npy_format.write_array_header_1_0(stream, header)
        stream.write(bytes(160))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(RadarSimError, match="cannot be read as samples"):
        load_radar(tmp_path / "radar_npy.json")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def test_points_far_from_their_triangle_are_refused(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Their motion kept the transform busy for more than 20 s."""
    path = run / contract.frame_dir(1) / contract.DEFORMING_SURFACES_FILE
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays["track_weights"][:] = 2.0**31
    np.savez(path, **arrays)
    correct_hashes(run)
    assert main(["process", str(run), "--no-plots"]) == 1
    assert "weights of corners" in capsys.readouterr().err


def test_deep_nesting_is_refused(run: Path) -> None:
    (run / "run.json").write_text("[" * 200_000, encoding="utf-8")
    with pytest.raises(RadarSimError, match="cannot be read as JSON"):
        open_run(run)
