#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make docs/images/scene_and_map.png: the paper's scene and the map that ``make demo`` measured.

make demo && .venv/bin/python scripts/make_readme_picture.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402
import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from bpy_extras.object_utils import world_to_camera_view  # noqa: E402
from mathutils import Vector  # noqa: E402

from scripts.examples.pictures import daylight, plain_material, render_from  # noqa: E402
from scripts.picture_text import use_readable_text  # noqa: E402

SIZE = (960, 720)
COLOURS = {
    "Plane": (0.35, 0.38, 0.34),
    "Block 1 km": (0.25, 0.45, 0.75),
    "Block 2.5 km": (0.25, 0.45, 0.75),
    "Target": (0.9, 0.15, 0.05),
}
LABELS = {
    "Block 1 km": "block, near face at 1000 m",
    "Block 2.5 km": "block, near face at 2500 m",
    "Target": "target, 1750 m,\nreceding at 10 m/s",
    "Radar": "radar, 100 m above the plane",
}


#: Where the labels stand, in points from what they name.
OFFSETS = {
    "Block 1 km": (40, -75),
    "Block 2.5 km": (-40, 62),
    "Target": (95, 62),
    "Radar": (-95, 10),
}


def render_scene(path: Path) -> dict[str, tuple[float, float]]:
    """An ordinary picture of the scene; returns where the labels go, in shares of the picture."""
    bpy.ops.wm.open_mainfile(
        filepath=str(ROOT / "blend_examples" / "paper_scene.blend"), use_scripts=False
    )
    scene = bpy.context.scene
    for name, colour in COLOURS.items():
        item = bpy.data.objects[name]
        item.data.materials.clear()
        item.data.materials.append(plain_material(name, colour))
    # Drawn larger than it is: 24 m would be two pixels.
    bpy.data.objects["Target"].scale = (3, 3, 3)
    bpy.ops.mesh.primitive_cone_add(radius1=0.25, depth=1.0, location=(0, 0, 0.5))
    bpy.context.object.data.materials.append(plain_material("radar", (0.95, 0.8, 0.1)))
    daylight(scene)
    camera = render_from(scene, (-8.5, 4.5, 6.0), (14.0, 0.3, -1.0), 50.0, SIZE, path)
    places = {}
    for name in LABELS:
        point = Vector((0, 0, 1.0)) if name == "Radar" else bpy.data.objects[name].location
        seen = world_to_camera_view(scene, camera, point)
        places[name] = (seen.x, seen.y)
    return places


def main() -> int:
    from radarsim_addon import signal

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    products = ROOT / "out" / "paper" / "run" / "products"
    if not (products / "frame_0001_map.npz").is_file():
        print("No map in out/paper: run `make demo` first.", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        picture = Path(folder) / "scene.png"
        places = render_scene(picture)
        image = plt.imread(picture)
    with np.load(products / "frame_0001_map.npz", allow_pickle=False) as data:
        power, range_m = data["power"][0], data["range_m"]
        doppler_hz, rate_mps = data["doppler_hz"], data["velocity_mps"]
    level = signal.power_to_db(power, power.max(), -80.0)

    use_readable_text(plt)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(12.5, 4.9), width_ratios=[1.25, 1], constrained_layout=True
    )
    left.imshow(image)
    left.set_axis_off()
    left.set_title("The scene in Blender (target drawn three times as large)", fontsize=13)
    for name, (x, y) in places.items():
        dx, dy = OFFSETS[name]
        left.annotate(
            LABELS[name],
            (x * SIZE[0], (1 - y) * SIZE[1]),
            xytext=(dx, dy),
            textcoords="offset points",
            fontsize=13,
            ha="center",
            arrowprops={"arrowstyle": "-", "lw": 0.8},
        )
    mesh = right.pcolormesh(rate_mps, range_m, level.T, cmap="viridis", shading="nearest")
    right.set_xlabel("range rate [m/s], receding on the right")
    right.set_ylabel("one-way range [m]")
    mps_per_hz = rate_mps[0] / doppler_hz[0]
    both = (lambda v: v / mps_per_hz, lambda f: f * mps_per_hz)
    top = right.secondary_xaxis("top", functions=both)
    top.set_xlabel("Doppler [Hz]")
    figure.colorbar(mesh, ax=right, label="power [dB re strongest cell]")
    for text, place, shift in (
        ("block, 1000 m", (0, 1000), (24, 14)),
        ("block, 2500 m", (0, 2500), (24, 14)),
        ("target", (10.0, 1750), (-50, 22)),
    ):
        right.annotate(
            text,
            place,
            xytext=shift,
            textcoords="offset points",
            color="w",
            fontsize=13,
            arrowprops={"arrowstyle": "-", "lw": 0.8, "color": "w"},
        )
    out = ROOT / "docs" / "images" / "scene_and_map.png"
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out, dpi=100)
    print(f"wrote {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
