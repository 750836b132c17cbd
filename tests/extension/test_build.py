# SPDX-License-Identifier: GPL-3.0-or-later
"""The archive holds what it should, no more, and is the same each time."""

from __future__ import annotations

import os
import shutil
import tomllib
import zipfile
from pathlib import Path

import pytest

import radarsim_addon
from scripts import build_extension
from tests.extension.conftest import PLATFORM


def names(archive: Path) -> set[str]:
    with zipfile.ZipFile(archive) as opened:
        return set(opened.namelist())


def test_every_module_is_in_it_and_nothing_else(archive: Path, root: Path):
    package = root / "radarsim_addon"
    modules = {path.relative_to(package).as_posix() for path in package.rglob("*.py")}
    assert modules <= names(archive)
    assert {"blender_manifest.toml", "LICENSE"} <= names(archive)
    assert not [name for name in names(archive) if "__pycache__" in name or name.endswith(".pyc")]
    with zipfile.ZipFile(archive) as opened:
        for name in sorted(modules):
            assert opened.read(name) == (package / name).read_bytes(), name


def test_no_file_of_the_package_is_forgotten(root: Path):
    """A new kind of file must be named in the build, or it would be missing in Blender alone."""
    package = root / "radarsim_addon"
    carried = set(build_extension.package_files())
    for path in package.rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".part":
            assert path.relative_to(package) in carried, path


def test_manifest(archive: Path):
    with zipfile.ZipFile(archive) as opened:
        manifest = tomllib.loads(opened.read("blender_manifest.toml").decode())
    assert manifest["id"] == "radarsim"
    assert manifest["version"] == radarsim_addon.__version__
    assert manifest["blender_version_min"] == "4.3.0"
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert archive.name == f"radarsim-{radarsim_addon.__version__}-{PLATFORM.replace('-', '_')}.zip"


def test_the_same_sources_give_the_same_bytes(
    archive: Path, tmp_path: Path, few_wheels: None, monkeypatch: pytest.MonkeyPatch
):
    copy = tmp_path / "elsewhere"
    shutil.copytree(
        build_extension.PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"),
        copy_function=shutil.copyfile,
    )  # fmt: skip
    for path in copy.rglob("*"):
        os.utime(path, (1e9, 1e9))
    monkeypatch.setattr(build_extension, "PACKAGE", copy)
    assert build_extension.build(tmp_path / "dist", PLATFORM).read_bytes() == archive.read_bytes()


@pytest.mark.parametrize(
    ("platform", "mark"),
    [("linux-x64", "x86_64"), ("windows-x64", "win_amd64"), ("macos-arm64", "arm64")],
)
def test_wheels_are_of_the_platform_and_for_both_pythons(platform: str, mark: str):
    found = build_extension.wheels_of(platform)
    kinds = {tuple(name.split("-")[::2][:2]) for name in found}
    for package in ("contourpy", "embreex", "kiwisolver", "matplotlib", "pillow", "scipy"):
        assert {(package, "cp311"), (package, "cp313")} <= kinds
    assert {package for package, python in kinds if "py3" in python} == {
        "cycler", "finufft", "fonttools", "packaging", "pyparsing", "python_dateutil", "six",
    }  # fmt: skip
    assert all(mark in name or name.endswith("-none-any.whl") for name in found)
    manifest = build_extension.read_manifest()["platforms"]
    assert platform in manifest and len(manifest) == len(build_extension.PLATFORMS)  # type: ignore[operator, arg-type]


def test_a_zip_names_its_wheels_and_its_platform(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fetch(name: str, digest: str) -> Path:
        path = tmp_path / name
        path.write_bytes(digest.encode())
        return path

    monkeypatch.setattr(build_extension, "fetch_wheel", fetch)
    archive = build_extension.build(tmp_path / "dist", "macos-arm64")
    assert archive.name == f"radarsim-{radarsim_addon.__version__}-macos_arm64.zip"
    with zipfile.ZipFile(archive) as opened:
        manifest = tomllib.loads(opened.read("blender_manifest.toml").decode())
    assert manifest["platforms"] == ["macos-arm64"]
    listed = {name.removeprefix("./") for name in manifest["wheels"]}
    assert listed == {f"wheels/{name}" for name in build_extension.wheels_of("macos-arm64")}
    assert listed <= names(archive)


def test_a_wheel_of_another_content_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(build_extension, "ROOT", tmp_path)
    folder = tmp_path / ".cache/wheels"
    folder.mkdir(parents=True)
    (folder / "one-1-py3-none-any.whl").write_bytes(b"changed")
    with pytest.raises(build_extension.BuildError, match=r"another SHA-256.*remove it"):
        build_extension.fetch_wheel("one-1-py3-none-any.whl", "0" * 64)


def test_a_version_that_differs_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    shutil.copytree(build_extension.PACKAGE, tmp_path / "package")
    manifest = tmp_path / "package/blender_manifest.toml"
    right = f'version = "{radarsim_addon.__version__}"'
    manifest.write_text(manifest.read_text().replace(right, 'version = "9.9.9"'))
    monkeypatch.setattr(build_extension, "PACKAGE", tmp_path / "package")
    with pytest.raises(build_extension.BuildError, match=r"'9\.9\.9'.*write the same in both"):
        build_extension.build(tmp_path / "dist", PLATFORM)
    assert not (tmp_path / "dist").exists()


def test_blender_refuses_a_broken_manifest(
    tmp_path: Path, few_wheels: None, monkeypatch: pytest.MonkeyPatch
):
    """The validation is Blender's own, so it does find what Blender would not install."""
    shutil.copytree(build_extension.PACKAGE, tmp_path / "package")
    manifest = tmp_path / "package/blender_manifest.toml"
    manifest.write_text(manifest.read_text().replace('"add-on"', '"plug-in"'))
    monkeypatch.setattr(build_extension, "PACKAGE", tmp_path / "package")
    with pytest.raises(build_extension.BuildError, match="plug-in"):
        build_extension.build(tmp_path / "dist", PLATFORM)


def test_the_command_says_where_they_are(
    tmp_path: Path, few_wheels: None, capsys: pytest.CaptureFixture[str]
):
    assert build_extension.main(["--out", str(tmp_path / "a b")]) == 0
    said = capsys.readouterr().out
    for platform in ("linux_x64", "windows_x64", "macos_arm64"):
        path = tmp_path / "a b" / f"radarsim-{radarsim_addon.__version__}-{platform}.zip"
        assert path.is_file() and str(path) in said
