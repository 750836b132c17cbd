#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make blend_examples/road.blend: multipath over a wet road, and the ghost of a car.

A radar at 24 GHz follows a car that drives away. The road is wet and smooth, and a metal noise
barrier stands next to it: both are mirrors. The echo of the car fades over range, and the barrier
makes ghosts of the car at longer ranges.

    python scripts/make_road.py [OUTPUT.blend]
    python scripts/make_road.py --picture docs/images/road.png     # measures all frames first
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

if __package__ in (None, ""):  # run from a checkout: the package lies next to scripts/
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np

from radarsim_addon.contract import PATHS_FILE, PathsRecord, frame_dir
from radarsim_addon.physics.materials import material
from radarsim_addon.physics.mirrors import MirrorMaterial
from radarsim_addon.signal.paths.table import open_table
from radarsim_addon.signal.radar import ConstantGain, CoverageSetup, Mount, two_ray_gain
from radarsim_addon.signal.scattering import interference_factors
from radarsim_addon.typed_json import read_record
from scripts.make_canyon import add_box, add_mesh

CARRIER_HZ, BANDWIDTH_HZ = 24.125e9, 250e6
WAVELENGTH_M = 299_792_458.0 / CARRIER_HZ
RESOLUTION_M = 299_792_458.0 / (2 * BANDWIDTH_HZ)
RADAR_HEIGHT_M = 0.5
#: Rear plate of the car, the strongest part of its echo: width, height and middle over the road.
PLATE_M = (0.52, 0.11, 0.6)
#: Distance of the plate in the first and in the last frame [m].
FIRST_M, LAST_M = 20.0, 60.0
FRAMES = 21
#: The noise barrier stands at this distance on the right of the radar and the car [m].
BARRIER_M = 10.0
ROAD_M = (-6.0, BARRIER_M, -10.0, 90.0)


def build() -> Any:
    """Build the scene in the current, empty file; return the radar."""
    from radarsim_addon import blender as radarsim
    from radarsim_addon.blender.materials import make_physical_material
    from radarsim_addon.blender.nodes import make_material
    from radarsim_addon.blender.scene import animation_curves

    scene = bpy.context.scene
    scene.unit_settings.system = "METRIC"
    scene.frame_start, scene.frame_end, scene.render.fps = 1, FRAMES, 5
    left, right, near, far = ROAD_M
    corners = [(left, near, 0.0), (right, near, 0.0), (right, far, 0.0), (left, far, 0.0)]
    road = add_mesh("Road", corners, [(0, 1, 2, 3)])
    barrier = add_box("Barrier", (BARRIER_M, near, 0.0), (BARRIER_M + 0.3, far, 3.0))
    radar = radarsim.add_radar(
        (0.0, 0.0, RADAR_HEIGHT_M),
        (0.0, 40.0, 0.8),
        field_of_view_deg=6.0,
        preset="doppler_24ghz",
        carrier_hz=CARRIER_HZ,
        bandwidth_hz=BANDWIDTH_HZ,
        adc_samples=256,
        adc_rate_hz=5e6,
        pulses=64,
        polarisation="horizontal",
        range_stop_m=70.0,
        sampling_mode="paths",
        max_reflections=3,
        width_px=160,
        height_px=80,
        replicates=4,
        use_link_budget=False,
        frame_mode="scene",
    )
    wet = make_physical_material("Wet Road", "water", carrier_hz=CARRIER_HZ, penetrable=False)
    radarsim.assign_material(road, wet)
    radarsim.assign_material(barrier, radarsim.material("metal", name="Smooth Metal"))
    body = make_material("Paint", 1.2, 0.0, specularity=0.0, penetrable=False)
    plate = make_material("Plate", 1e4, 1e4, specularity=0.0, penetrable=False)
    width, height, middle = PLATE_M
    car = add_box("Car", (-0.85, 0.02, 0.25), (0.85, 4.2, 1.45))
    low, high = middle - height / 2, middle + height / 2
    rear = [(-width / 2, 0, low), (width / 2, 0, low), (width / 2, 0, high), (-width / 2, 0, high)]
    plate_object = add_mesh("Rear Plate", rear, [(0, 1, 2, 3)])
    plate_object.parent = car
    radarsim.assign_material(car, body)
    radarsim.assign_material(plate_object, plate)
    for frame, y in ((1, FIRST_M), (FRAMES, LAST_M)):
        car.location.y = y
        car.keyframe_insert("location", frame=frame)
    for curve in animation_curves(car.animation_data):
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"
    return radar


def fading(run: Any, frame: int) -> tuple[float, float]:
    """Return distance [m] and fading of the plate in a frame of a run.

    Fading is the mean power of all its paths, direct and via the road, over that of the direct
    ones. Paths via the barrier have other ranges and are left out.
    """
    folder = run.path / frame_dir(frame)
    record = read_record(folder / PATHS_FILE, PathsRecord)
    rows = open_table(folder / record.table_file).copy()
    rows = rows[rows["last_object"] == record.objects.index("Rear Plate") + 1]
    road = [0, *(n for n, one in enumerate(record.images, 1) if one.objects == ["Road"])]
    rows = rows[np.isin(rows["transmitter_image"], road) & np.isin(rows["receiver_image"], road)]
    rows = rows[rows["order"] - rows["mirrors"] == 1]
    factor = interference_factors(rows, rows["power_w"], CARRIER_HZ, RESOLUTION_M)
    direct = rows[rows["mirrors"] == 0]
    faded = np.sum(rows["power_w"] * factor) / np.sum(direct["power_w"])
    return float(np.average(direct["length_m"], weights=direct["power_w"])) / 2, float(faded)


def two_ray(distance_m: float) -> float:
    """Return the fading of the plate by the textbook: the mean of |1 + Gamma* exp(-jk d)|^4."""
    mount = Mount(ConstantGain(), RADAR_HEIGHT_M, np.eye(4))
    water = MirrorMaterial(complex(material("water", CARRIER_HZ)), 1.0, True)
    setup = CoverageSetup(mount, mount, water, WAVELENGTH_M, "horizontal", math.inf)
    _, height, middle = PLATE_M
    heights_m = middle + height * ((np.arange(200) + 0.5) / 200 - 0.5)
    return float(two_ray_gain(setup, heights_m, distance_m).mean())


def picture(path: Path) -> None:
    """Measure all frames; draw range profiles over the car's distance, and the fading."""
    from radarsim_addon import blender as radarsim
    from radarsim_addon.signal import expected_power
    from radarsim_addon.signal.pictures import new_figure, save_figure

    with tempfile.TemporaryDirectory() as folder:
        run = radarsim.measure(build(), Path(folder) / "run", frames=range(1, FRAMES + 1))
        profiles = [expected_power(run.frame(n)) for n in range(1, FRAMES + 1)]
        found = np.array([fading(run, n) for n in range(1, FRAMES + 1)])
    figure = new_figure(11, 5)
    left, right = figure.subplots(1, 2)
    level = 10 * np.log10(np.maximum([one.profile for one in profiles], 1e-300))
    mesh = left.pcolormesh(
        found[:, 0], profiles[0].range_m, level.T, vmin=level.max() - 60, vmax=level.max(),
        shading="nearest", rasterized=True,
    )  # fmt: skip
    left.set_ylim(15, 70)
    left.set_xlabel("distance of the car [m]")
    left.set_ylabel("range [m]")
    left.set_title("simulated power: the car, its ghosts above", fontsize=10)
    figure.colorbar(mesh, ax=left, label="dBW")
    fine = np.linspace(FIRST_M, LAST_M, 400)
    textbook = [two_ray(distance) for distance in fine]
    right.plot(fine, 10 * np.log10(textbook), label="two-ray model")
    right.plot(found[:, 0], 10 * np.log10(found[:, 1]), "o", markersize=4, label="simulated")
    right.set_xlabel("distance of the car [m]")
    right.set_ylabel("echo of the rear plate over free space [dB]")
    right.set_title("fading over the wet road", fontsize=10)
    right.grid(alpha=0.3)
    right.legend()
    save_figure(figure, path)


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path(__file__).resolve().parents[1] / "blend_examples" / "road.blend"
    parser.add_argument("output", nargs="?", type=Path, default=default)
    parser.add_argument("--picture", type=Path, help="measure, and draw this picture instead")
    chosen = parser.parse_args(argv)
    output = chosen.picture or chosen.output
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if chosen.picture:
        picture(output)
        print(f"wrote {output}")
        return 0
    build()
    # Compressed, and without the preview picture, which would differ from machine to machine.
    bpy.context.preferences.filepaths.file_preview_type = "NONE"
    bpy.ops.wm.save_as_mainfile(filepath=str(output.resolve()), compress=True)
    print(f"wrote {output}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
