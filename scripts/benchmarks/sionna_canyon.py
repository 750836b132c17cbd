# SPDX-License-Identifier: GPL-3.0-or-later
"""The street canyon by Sionna RT, where it is installed: processor time, memory, error.

    python -m scripts.benchmarks.sionna_canyon SCENE.json RESULT.json

in a process of its own. Sionna RT needs a libLLVM (DRJIT_LIBLLVM_PATH): that of LLVM 15 crashes on
processors with AVX-512, that of 19 does not. All surfaces scatter as Lambert's law says. The error
is the scatter about the mean of the runs.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

_RUNS = 7
_RAYS = 10**6
_LIGHT_MPS = 299_792_458.0


def run_sionna(folder: Path) -> dict[str, dict[str, float]]:
    """Return figures by order; empty where Sionna RT is not installed, or fails."""
    found: dict[str, dict[str, float]] = {}
    if importlib.util.find_spec("sionna") is None:
        return found
    from scripts import make_canyon

    from .clock import command_cost

    for order in (1, 2):
        given = {"boxes": make_canyon.blocks(), "ground": make_canyon.GROUND_M, "order": order}
        scene, result = folder / "canyon.json", folder / "sionna.json"
        scene.write_text(json.dumps(given), encoding="utf-8")
        root = Path(__file__).resolve().parents[2]
        try:
            cost = command_cost(["-m", "scripts.benchmarks.sionna_canyon", scene, result], root)
        except RuntimeError as error:
            print(f"radarsim bench: Sionna RT: {error}")
            return {}
        found[str(order)] = {**json.loads(result.read_text(encoding="utf-8")), "mib": cost.peak_mib}
    return found


def main(scene_file: str, result_file: str) -> None:
    """Trace the scene several times; the first one, which compiles, does not count."""
    sionna: Any = importlib.import_module("sionna.rt")
    given = json.loads(Path(scene_file).read_text(encoding="utf-8"))
    description = Path(result_file).with_suffix(".xml")
    description.write_text(_xml(given["boxes"], given["ground"]), encoding="utf-8")
    scene = sionna.load_scene(str(description), merge_shapes=False)
    scene.frequency = 5.3e9
    for material in scene.radio_materials.values():
        material.scattering_coefficient = 1.0
    array = {"num_rows": 1, "num_cols": 1, "pattern": "iso", "polarization": "V"}
    scene.tx_array = scene.rx_array = sionna.PlanarArray(**array)
    scene.add(sionna.Transmitter("tx", [0, 0, 2.0]))
    scene.add(sionna.Receiver("rx", [0, 0, 2.0]))
    solver, order = sionna.PathSolver(), given["order"]
    seconds, profiles = [], []
    for seed in range(_RUNS + 1):
        started_s = time.process_time()
        paths = solver(
            scene,
            max_depth=order,
            samples_per_src=_RAYS,
            max_num_paths_per_src=4 * _RAYS,
            los=False,
            specular_reflection=False,
            diffuse_reflection=True,
            refraction=False,
            synthetic_array=False,
            seed=seed + 1,
        )
        power = sum(np.array(part).ravel() ** 2 for part in paths.a)
        range_m = np.array(paths.tau).ravel() * _LIGHT_MPS / 2
        if order > 1:  # second reflections alone
            kinds = np.array(paths.interactions)
            power = power * (kinds.reshape(kinds.shape[0], -1)[1] != 0)
        profiles.append(np.histogram(range_m, np.arange(101.0), weights=power)[0])
        seconds.append(time.process_time() - started_s)
    shown = np.stack(profiles[1:])[:, 12 if order > 1 else 2 : 75]
    errors_db = 10 * np.log10(shown / shown.mean(axis=0))
    found = {
        "render_s": statistics.median(seconds[1:]),
        "first_s": seconds[0],
        "error_db": float(np.sqrt(np.mean(errors_db**2) * _RUNS / (_RUNS - 1))),
    }
    Path(result_file).write_text(json.dumps(found), encoding="utf-8")


def _xml(boxes: Sequence[Any], ground: Sequence[float]) -> str:
    """The scene in Mitsuba's format."""
    x, y = ground
    solids = [*boxes, ((-x, -y, -0.5), (x, y, 0.0))]
    shapes = []
    for number, (low, high) in enumerate(solids):
        half = [(b - a) / 2 for a, b in zip(low, high)]
        middle = [(a + b) / 2 for a, b in zip(low, high)]
        steps = "".join(
            f'<{what} x="{v[0]}" y="{v[1]}" z="{v[2]}"/>'
            for what, v in (("scale", half), ("translate", middle))
        )
        shapes.append(
            f'<shape type="cube" id="box{number}"><transform name="to_world">{steps}</transform>'
            '<ref id="concrete" name="bsdf"/></shape>'
        )
    material = '<string name="type" value="concrete"/><float name="thickness" value="0.3"/>'
    return (
        f'<scene version="2.1.0"><bsdf type="itu-radio-material" id="concrete">{material}</bsdf>'
        f"{''.join(shapes)}</scene>"
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
