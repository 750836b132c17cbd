# SPDX-License-Identifier: GPL-3.0-or-later
"""Physics must run inside a Blender program, which has numpy and neither scipy nor matplotlib."""

import ast
import pkgutil
import subprocess
import sys
from pathlib import Path

from radarsim_addon import physics

SCRIPT = """
import sys
for name in ("bpy", "mathutils", "scipy", "matplotlib", "finufft", "OpenEXR"):
    sys.modules[name] = None
import importlib
for name in sys.argv[1:]:
    importlib.import_module("radarsim_addon.physics." + name)
from radarsim_addon.physics.materials import material
from radarsim_addon.physics.rough import albedo
print(abs(material("soil", 5.3e9, moisture=0.2)) > 1, albedo(0.2, 0.5) < 1)
foreign = [m for m in sys.modules if m.startswith("radarsim_addon.") and ".physics" not in m]
print(sorted(foreign))
"""


def test_every_module_imports_with_numpy_alone() -> None:
    modules = [module.name for module in pkgutil.iter_modules(physics.__path__)]
    assert len(modules) > 10
    root = Path(physics.__path__[0]).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *modules], cwd=root, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    ran, imported = done.stdout.splitlines()
    assert ran == "True True"
    roots = {name.split(".")[1] for name in ast.literal_eval(imported)}
    assert roots == {"arrays", "atomic_files", "errors", "findings", "processes", "terminal"}
