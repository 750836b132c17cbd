# SPDX-License-Identifier: GPL-3.0-or-later
"""Who may import whom: held by walking the imports, not by good will."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "radarsim_addon"

#: The flow of signal. A stage imports stages before it only.
FLOW = [
    "config", "codes", "waveform_pulses", "waveform_lines", "waveform_files", "exrheader", "exr",
    "files", "frames", "decode", "doppler", "paths", "nufft", "windows", "waveform", "phase",
    "synthesis", "echoes", "linesynthesis", "linecompress", "compress", "rangedoppler", "detect",
    "products", "plots", "pipeline", "cli",
]  # fmt: skip


def imports(path: Path) -> set[str]:
    """Absolute dotted names of all that a module imports, functions included."""
    package = list(path.relative_to(PACKAGE.parent).with_suffix("").parts[:-1])
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            found.add(module)
            found.update(f"{module}.{alias.name}" for alias in node.names)
    return found


def modules(folder: str) -> list[Path]:
    return sorted((PACKAGE / folder).rglob("*.py"))


def test_the_walk_sees_imports() -> None:
    assert "radarsim_addon.signal.runs.run" in imports(PACKAGE / "signal" / "cli.py")
    assert "radarsim_addon.errors" in imports(PACKAGE / "signal" / "exr.py")
    assert len(modules("signal")) > 15


@pytest.mark.parametrize("path", [*modules("signal"), *modules("physics")], ids=lambda p: p.name)
def test_signal_and_physics_know_no_blender(path: Path) -> None:
    for name in imports(path):
        top = name.split(".")
        assert top[0] not in {"bpy", "mathutils", "bmesh", "gpu", "pickle"}, name
        assert not name.startswith("radarsim_addon.blender"), name
        if path.parent.name == "physics":
            assert not name.startswith("radarsim_addon.signal"), name


@pytest.mark.parametrize("stage", FLOW)
def test_stages_import_downwards_only(stage: str) -> None:
    for name in imports(PACKAGE / "signal" / f"{stage}.py"):
        parts = name.split(".")
        if parts[:2] == ["radarsim_addon", "signal"] and len(parts) > 2 and parts[2] in FLOW:
            assert FLOW.index(parts[2]) < FLOW.index(stage), f"{stage} imports {parts[2]}"


@pytest.mark.parametrize("path", modules("."), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_inside_the_package_imports_are_relative(path: Path) -> None:
    """As an extension the package has another name."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names.append(node.module or "")
        assert not any(name.split(".")[0] == "radarsim_addon" for name in names)


def test_import_brings_in_numpy_and_nothing_heavy() -> None:
    code = (
        "import sys, radarsim_addon; assert 'numpy' not in sys.modules\n"
        "import radarsim_addon.signal\n"
        "heavy = {'bpy', 'scipy', 'matplotlib', 'finufft', 'OpenEXR', 'OpenImageIO'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=PACKAGE.parent, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_all_names_of_the_namespace_are_there() -> None:
    from radarsim_addon import signal

    for name in signal.__all__:
        assert hasattr(signal, name)
        assert name in (signal.__doc__ or ""), f"{name} is not in the reference index"
