# SPDX-License-Identifier: GPL-3.0-or-later
"""The street canyon by Sionna RT, where it is installed: processor time, memory, error, powers.

    python -m scripts.benchmarks.sionna_canyon cost SCENE.json RESULT.json
    python -m scripts.benchmarks.sionna_canyon powers SCENE.json RESULT.json

in a process of its own. Sionna RT needs a libLLVM (DRJIT_LIBLLVM_PATH): that of LLVM 15 crashes on
processors with AVX-512, that of 19 does not. All surfaces scatter as Lambert's law says. The error
of single reflections is that against their integral: their rays are the same in all runs. That of
second reflections is the scatter about the mean of the runs.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon.arrays import Real

_RUNS = 7
_RAYS = 10**6
_LIGHT_MPS = 299_792_458.0


def run_sionna(folder: Path) -> dict[str, dict[str, float]]:
    """Return figures by order; empty where Sionna RT is not installed, or fails."""
    found: dict[str, dict[str, float]] = {}
    if importlib.util.find_spec("sionna") is None:
        return found
    for order in (1, 2):
        try:
            result, mib = _in_process("cost", folder, order)
        except RuntimeError as error:
            print(f"radarsim bench: Sionna RT: {error}")
            return {}
        found[str(order)] = {**result, "mib": mib}
    powers = _in_process("powers", folder, 1)[0]["power_w"]
    found["1"]["error_db"] = _error_db(np.array(powers))
    return found


def _error_db(power_w: Real) -> float:
    """Return the rms error of single reflections in the bins of the street, for an EIRP of 1 W."""
    from radarsim_addon.physics.radar_equation import effective_area_m2
    from scripts import make_canyon

    from .canyon_accuracy import EDGES_M, errors_db
    from .canyon_profile import first_order_profile

    indices = complex(*make_canyon.CONCRETE), complex(*make_canyon.GROUND)
    place = make_canyon.GROUND_M, make_canyon.RADAR_HEIGHT_M
    profile = first_order_profile(make_canyon.blocks(), *place, indices, EDGES_M)
    expected_w = profile * effective_area_m2(_LIGHT_MPS / 5.3e9)
    return float(np.sqrt(np.mean(errors_db(power_w, expected_w) ** 2)))


def power_profiles() -> tuple[Real, Real]:
    """Return the power of one and of two reflections in bins of 1 m, for an EIRP of 1 W [W].

    Means over all runs, over both transmitted polarisations, and summed over both received ones.
    Half of the scattered power has the other polarisation, as in radarsim, whose surfaces
    depolarise.
    """
    with tempfile.TemporaryDirectory(prefix="radarsim_sionna_") as name:
        first, second = (_in_process("powers", Path(name), order)[0] for order in (1, 2))
    return np.array(first["power_w"]), np.array(second["power_w"])


def _in_process(task: str, folder: Path, order: int) -> tuple[dict[str, Any], float]:
    """Run this module for one order; return its result, and its memory [MiB]."""
    from scripts import make_canyon

    from .clock import command_cost

    given = {"boxes": make_canyon.blocks(), "ground": make_canyon.GROUND_M, "order": order}
    scene, result = folder / "canyon.json", folder / "sionna.json"
    scene.write_text(json.dumps(given), encoding="utf-8")
    root = Path(__file__).resolve().parents[2]
    cost = command_cost(["-m", "scripts.benchmarks.sionna_canyon", task, scene, result], root)
    return json.loads(result.read_text(encoding="utf-8")), cost.peak_mib


def main(task: str, scene_file: str, result_file: str) -> None:
    """Trace the scene several times; the first one, which compiles, does not count."""
    given = json.loads(Path(scene_file).read_text(encoding="utf-8"))
    order, powers = given["order"], task == "powers"
    description = Path(result_file).with_suffix(".xml")
    description.write_text(_xml(given["boxes"], given["ground"], powers), encoding="utf-8")
    sionna, scene = _scene(description, "VH" if powers else "V", 0.5 if powers else 0.0)
    solver = sionna.PathSolver()
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
        real, imaginary = (np.array(part, dtype=float) for part in paths.a)
        power = real**2 + imaginary**2
        range_m = np.array(paths.tau) * _LIGHT_MPS / 2
        if order > 1:  # second reflections alone
            power = power * (np.array(paths.interactions)[1] != 0)
        found = np.histogram(range_m.ravel(), np.arange(101.0), weights=power.ravel())[0]
        profiles.append(found / 2 if powers else found)  # the mean of two transmitters
        seconds.append(time.process_time() - started_s)
    mean = np.mean(profiles[1:], axis=0)
    shown = slice(12 if order > 1 else 2, 75)
    errors_db = 10 * np.log10(np.stack(profiles[1:])[:, shown] / mean[shown])
    result = {
        "render_s": statistics.median(seconds[1:]),
        "first_s": seconds[0],
        "error_db": float(np.sqrt(np.mean(errors_db**2) * _RUNS / (_RUNS - 1))),
    }
    Path(result_file).write_text(
        json.dumps({"power_w": mean.tolist()} if powers else result), encoding="utf-8"
    )


def _scene(description: Path, polarisation: str, cross_polarised: float) -> tuple[Any, Any]:
    """Sionna RT, and the scene with a transmitter and a receiver at one place."""
    sionna: Any = importlib.import_module("sionna.rt")
    scene = sionna.load_scene(str(description), merge_shapes=False)
    scene.frequency = 5.3e9
    for material in scene.radio_materials.values():
        material.scattering_coefficient = 1.0
        material.xpd_coefficient = cross_polarised
    array = {"num_rows": 1, "num_cols": 1, "pattern": "iso", "polarization": polarisation}
    scene.tx_array = scene.rx_array = sionna.PlanarArray(**array)
    scene.add(sionna.Transmitter("tx", [0, 0, 2.0]))
    scene.add(sionna.Receiver("rx", [0, 0, 2.0]))
    return sionna, scene


def _xml(boxes: Sequence[Any], ground: Sequence[float], earth: bool) -> str:
    """The scene in Mitsuba's format; all of concrete, or with a ground of earth."""
    x, y = ground
    solids = [*boxes, ((-x, -y, -0.5), (x, y, 0.0))]
    shapes, names = [], ("concrete", "medium_dry_ground")
    for number, (low, high) in enumerate(solids):
        half = [(b - a) / 2 for a, b in zip(low, high)]
        middle = [(a + b) / 2 for a, b in zip(low, high)]
        steps = "".join(
            f'<{what} x="{v[0]}" y="{v[1]}" z="{v[2]}"/>'
            for what, v in (("scale", half), ("translate", middle))
        )
        shapes.append(
            f'<shape type="cube" id="box{number}"><transform name="to_world">{steps}</transform>'
            f'<ref id="{names[number == len(boxes) and earth]}" name="bsdf"/></shape>'
        )
    materials = "".join(
        f'<bsdf type="itu-radio-material" id="{name}"><string name="type" value="{name}"/>'
        '<float name="thickness" value="0.3"/></bsdf>'
        for name in names[: 1 + earth]
    )
    return f'<scene version="2.1.0">{materials}{"".join(shapes)}</scene>'


if __name__ == "__main__":
    main(*sys.argv[1:])
