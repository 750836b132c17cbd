# SPDX-License-Identifier: GPL-3.0-or-later
"""Which module may import which. The test reads the imports of the package and the scripts."""

from __future__ import annotations

import ast
import functools
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "radarsim_addon"

#: Rooms in the order of the data's way. A room imports only rooms before it.
ROOMS = (
    "", "physics",
    "signal.scene", "signal.radar", "signal.motion", "signal.runs", "signal.paths",
    "signal.spectrum",
    "signal.decoding", "signal.tracing", "signal.scattering", "signal.echoes", "signal.maps",
    "signal.angles",
    "signal.detection", "signal.draft", "signal.products", "signal.pictures",
    "signal.pipeline", "signal",
    "blender.state", "blender.plan", "blender.nodes", "blender.materials", "blender.scene",
    "blender.rig_settings", "blender.views", "blender.motion", "blender.run", "blender.rings",
    "blender.paths", "blender.headless", "blender.ui", "blender",
)  # fmt: skip
#: Entry points: they stand at the root of the package and join both halves.
ENTRIES = ("radarsim_addon", "radarsim_addon.__main__", "radarsim_addon.frame_worker")
#: Rooms of signal that the Blender half may use; the last ones only where results are shown.
FOR_BLENDER = {"scene", "radar", "motion", "paths", "decoding", "runs", "tracing"}
FOR_WINDOWS = {"pipeline", "detection", "draft", "pictures"}
BLENDER_MODULES = {"bpy", "bpy_extras", "mathutils", "bmesh", "gpu", "blf"}


class Import(NamedTuple):
    """One imported name: who imports it, from which module, and the name."""

    importer: str
    module: str
    name: str


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@functools.cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@pytest.fixture(autouse=True, scope="module")
def trees_forgotten() -> Iterator[None]:
    """Millions of nodes would slow each later collection of garbage."""
    yield
    tree_of.cache_clear()


def imports(path: Path, name: str) -> Iterator[Import]:
    """All imports of a file, those within functions included."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(name, alias.name, "")
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1]
            module = ".".join([*(base if node.level else []), *filter(None, [node.module])])
            for alias in node.names:
                inner = f"{module}.{alias.name}"
                yield Import(name, *((inner, "") if inner in MODULES else (module, alias.name)))


def room_of(module: str) -> str:
    inner = module.removeprefix("radarsim_addon").removeprefix(".")
    return max((r for r in ROOMS if f"{inner}.".startswith(f"{r}." if r else "")), key=len)


# Not as the file is collected, which each process does.
@functools.cache
def package_imports() -> list[Import]:
    return [item for name, path in MODULES.items() for item in imports(path, name)]


def imports_inside() -> list[Import]:
    return [item for item in package_imports() if item.module.startswith("radarsim_addon")]


def imports_of_scripts() -> list[Import]:
    return [
        item
        for path in sorted((ROOT / "scripts").rglob("*.py"))
        for item in imports(path, module_name(path))
        if item.module.startswith("radarsim_addon")
    ]


def test_the_walk_finds_rooms_and_imports() -> None:
    assert room_of("radarsim_addon.signal.radar.waveforms") == "signal.radar"
    assert room_of("radarsim_addon.errors") == ""
    assert room_of("radarsim_addon.blender.addon") == "blender"
    inside = imports_inside()
    assert (
        Import("radarsim_addon.signal.runs.run", "radarsim_addon.contract", "RunRecord") in inside
    )
    assert len(MODULES) > 200 and len(inside) > 1000 and len(imports_of_scripts()) > 50


def test_rooms_import_downwards_only() -> None:
    upward = [
        item
        for item in imports_inside()
        if item.importer not in ENTRIES
        and ROOMS.index(room_of(item.module)) > ROOMS.index(room_of(item.importer))
    ]
    assert not upward


def test_blender_uses_few_rooms_of_signal() -> None:
    for item in imports_inside():
        here, there = room_of(item.importer), room_of(item.module)
        if here.startswith("blender") and there.startswith("signal"):
            shows = here in ("blender.headless", "blender.ui")
            allowed = FOR_BLENDER | FOR_WINDOWS if shows else FOR_BLENDER
            assert there.removeprefix("signal.") in allowed, item


#: Attributes by which Blender's objects and meshes are read, and by which rays are cast.
READING = {"object_instances", "loop_triangles", "evaluated_get", "to_mesh_clear", "depsgraph"}
READING |= {"evaluated_depsgraph_get", "loops"}
RAYS = {"EmbreeDevice", "EmbreeScene", "BVHTree", "ray_cast", "closest_point_on_mesh"}
#: Attributes by which links between nodes are followed.
FOLLOWING = {"is_linked", "from_node", "from_socket", "to_node", "to_socket"}


def modules_that(reads: Callable[[ast.AST], bool]) -> set[str]:
    found = {name for name, path in MODULES.items() if any(map(reads, ast.walk(tree_of(path))))}
    return {name.removeprefix("radarsim_addon.") for name in found}


def test_few_rooms_read_what_blender_evaluates_and_cast_rays() -> None:
    """All others are given a snapshot, its meshes, and `RayMesh` or `RayScene`."""

    def reads(node: ast.AST) -> bool:
        return isinstance(node, ast.Attribute) and node.attr in READING

    def casts(node: ast.AST) -> bool:
        name = node.attr if isinstance(node, ast.Attribute) else getattr(node, "name", "")
        return name in RAYS

    assert modules_that(reads) == {"blender.state.meshes", "blender.state.snapshot"}
    assert modules_that(casts) == {"signal.scene.rays"}


def test_few_modules_read_node_sockets() -> None:
    """Others ask the room of nodes, or have a material read as a `Surface`."""

    def reads(node: ast.AST) -> bool:
        if not isinstance(node, ast.Attribute):
            return False
        value = node.attr == "default_value" and isinstance(node.ctx, ast.Load)
        return value or node.attr in FOLLOWING

    outside = {name for name in modules_that(reads) if not name.startswith("blender.nodes.")}
    # a surface; what views add to radarsim's own groups
    own = {"blender.views.joint_render", "blender.views.view_setup"}
    assert outside == {"blender.materials.surfaces", *own}


def test_no_circle_of_modules() -> None:
    graph: dict[str, set[str]] = defaultdict(set)
    for item in imports_inside():
        # A room's __init__ is executed when one of its modules is; it imports them all.
        if MODULES.get(item.importer, PACKAGE).name != "__init__.py":
            graph[item.importer].add(item.module)
    done: set[str] = set()

    def visit(module: str, way: tuple[str, ...]) -> None:
        assert module not in way, " -> ".join((*way[way.index(module) :], module))
        if module not in done:
            for target in graph[module]:
                visit(target, (*way, module))
            done.add(module)

    for module in list(graph):
        visit(module, ())


@pytest.mark.parametrize("items", [imports_inside, imports_of_scripts])
def test_private_names_stay_in_their_room(items: Callable[[], list[Import]]) -> None:
    for item in items():
        private = item.name.startswith("_") and not item.name.startswith("__")
        same_room = item.importer in MODULES and room_of(item.importer) == room_of(item.module)
        assert not private or same_room, item


def test_signal_and_physics_do_not_import_blender() -> None:
    for item in package_imports():
        top = item.module.partition(".")[0]
        assert top != "pickle", item
        if not room_of(item.importer).startswith("blender"):
            assert top not in BLENDER_MODULES, item


def test_a_function_does_not_share_its_modules_name() -> None:
    for name, path in MODULES.items():
        own = {n.name for n in tree_of(path).body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
        assert name.rpartition(".")[2] not in own, name


@pytest.mark.parametrize("room", [room for room in ROOMS if "." in room])
def test_a_room_says_what_it_is_and_what_others_may_use(room: str) -> None:
    path = MODULES[f"radarsim_addon.{room}"]
    assert ast.get_docstring(tree_of(path)), room
    if not room.startswith("blender"):
        import importlib

        module = importlib.import_module(f"radarsim_addon.{room}")
        assert all(hasattr(module, name) for name in module.__all__)


def test_inside_the_package_imports_are_relative() -> None:
    """As an extension the package has another name."""
    for path in MODULES.values():
        for node in ast.walk(tree_of(path)):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                names.append(node.module or "")
            assert not any(name.split(".")[0] == "radarsim_addon" for name in names), path


def test_import_brings_in_numpy_and_nothing_heavy() -> None:
    code = (
        "import sys, radarsim_addon; assert 'numpy' not in sys.modules\n"
        "import radarsim_addon.signal\n"
        "heavy = {'bpy', 'scipy', 'matplotlib', 'finufft', 'OpenEXR', 'OpenImageIO'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_all_names_of_the_namespace_are_there() -> None:
    from radarsim_addon import signal

    for name in signal.__all__:
        assert hasattr(signal, name)
        assert name in (signal.__doc__ or ""), f"{name} is not in the reference index"
