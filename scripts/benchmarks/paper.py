# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's scene measured by rings and by paths: cost, range profile, power of the target."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon import contract
from radarsim_addon.arrays import Real
from radarsim_addon.physics.radar_equation import effective_area_m2
from radarsim_addon.signal import Paths, iter_path_chunks, make_paths, open_run
from radarsim_addon.signal.decoding import pixel_grid
from radarsim_addon.signal.maps import expected_power_profile
from radarsim_addon.signal.paths import spread, steps_of, tiles_by_replicate
from radarsim_addon.signal.paths.paths import path_power_w
from radarsim_addon.signal.paths.table import open_table
from radarsim_addon.signal.radar import Radar
from radarsim_addon.typed_json import read_record

from .clock import Cost, peak_mib, stopwatch

#: What rings and paths are compared over: all that 21 rings of 250 m cover [m].
WINDOW_M = (0.0, 5250.0)
#: The target's near face and size, as make_paper_scene.py builds it [m, degrees].
TARGET = "Target"
_TARGET_RANGE_M = (1740.0, 1800.0)
_TARGET_AZIMUTH_DEG = 1.5
#: Half the side of a box around the target's centre that holds it (0.39 degrees) and no ground of
#: its range (3.3 degrees down) [degrees].
_TARGET_BOX_DEG = 1.0
#: Rows of a table that are read at a time.
_CHUNK = 1 << 19


@dataclass
class Result:
    """One acquisition of the scene.

    Attributes
    ----------
    sampling_mode, label
        "rings" or "paths", and its settings in words.
    acquire, process
        Cost from the scene to the files, and from the files to the profile.
    samples
        Camera rays in all renders together (rings) or rows of the table (paths).
    profile
        Expected power at each range bin [W].
    target_w
        Power of the target [W].
    replicates
        Profiles of single replicates (paths), for the standard error.
    """

    sampling_mode: str
    label: str
    acquire: Cost
    process: Cost
    samples: int
    renders: int
    profile: Real
    target_w: float
    details: dict[str, Any] = dataclasses.field(default_factory=dict)
    replicates: list[Real] = dataclasses.field(default_factory=list)

    @property
    def wall_s(self) -> float:
        return self.acquire.wall_s + self.process.wall_s

    @property
    def cpu_s(self) -> float:
        return self.acquire.cpu_s + self.process.cpu_s


class PaperScene:
    """The scene, opened once in this process."""

    def __init__(self, blend: Path, folder: Path) -> None:
        import bpy

        bpy.ops.wm.open_mainfile(filepath=str(blend))
        self._rig = bpy.data.objects["Radar"]
        self._folder = folder

    def rings(
        self, width_px: int, height_px: int, samples: int, count: int | None = None
    ) -> Result:
        """Rings of 250 m, one snapshot: 21 as in the scene, or so many."""
        folder = self._fresh("rings")
        values: dict[str, Any] = {"width_px": width_px, "height_px": height_px, "samples": samples}
        values["snapshots"] = 1
        if count is not None:
            values["rings"] = count
        with stopwatch() as acquire:
            radarsim.measure(self._rig, folder, sampling_mode="rings", **values)
        with stopwatch() as process:
            run = open_run(folder)
            target = TargetSum(run.radar.waveform.wavelength_m)
            paths = target.ring_paths(run.frame(1))
            profile = range_profile(paths, run.radar)
        rings = run.record.rings
        shutil.rmtree(folder)
        return Result(
            "rings",
            f"{width_px}x{height_px}, {samples} spp",
            acquire,
            process,
            width_px * height_px * samples * rings,
            rings,
            profile,
            target.power_w,
        )

    def paths(
        self, width_px: int, height_px: int, *, single_rays: bool = False, **options: Any
    ) -> Result:
        """Paths with these settings of the radar."""
        folder = self._fresh("paths")
        # One snapshot of rings has no motion either.
        values = {"motion": "off", "snapshots": 1, **options}
        with stopwatch() as acquire:
            run = radarsim.measure(
                self._rig,
                folder,
                sampling_mode="paths",
                width_px=width_px,
                height_px=height_px,
                **values,
            )
        peak = peak_mib()  # before the table is read: a mapped file counts as memory
        frame = folder / contract.frame_dir(1)
        record = read_record(frame / contract.PATHS_FILE, contract.PathsRecord)
        number = record.objects.index(TARGET) + 1
        wavelength_m = run.radar.waveform.wavelength_m
        with stopwatch() as process:
            rows = open_table(frame / record.table_file)
            if single_rays:  # a reference of single rays, which presumes nothing of what is between
                points = table_paths(rows, wavelength_m)
            else:
                points = spread_paths(rows, record, run.radar)
            profile = range_profile(points, run.radar)
            target_w = table_sum(rows, "power_w", number)
        single = []
        if single_rays:
            for replicate in range(record.replicates):
                paths = table_paths(rows, wavelength_m, replicate)
                single.append(record.replicates * range_profile(paths, run.radar))
        details = {
            "tiles": record.tiles,
            "finest_refinement_level": record.finest_refinement_level,
            "relative_error": record.relative_error,
            "reached": record.stop_reason,
            "truncated_transparency_fraction": record.truncated_transparency_fraction,
            "peak_mib": peak,
            "target_sr": table_sum(rows, "solid_angle_sr", number),
        }
        del rows
        shutil.rmtree(folder)
        label = f"{width_px}x{height_px}, {record.replicates} replicate"
        label += "s" * (record.replicates > 1)
        if options.get("max_standard_error"):
            label += f", {100 * options['max_standard_error']:g} %"
            label += f" of {options['refine_for']}" if "refine_for" in options else ""
        return Result(
            "paths",
            label,
            acquire,
            process,
            record.path_count,
            record.renders,
            profile,
            target_w,
            details,
            single,
        )

    def _fresh(self, name: str) -> Path:
        folder = self._folder / name
        shutil.rmtree(folder, ignore_errors=True)
        return folder


class TargetSum:
    """Adds up the target's power while a frame's rings stream by."""

    def __init__(self, wavelength_m: float) -> None:
        self._wavelength_m = wavelength_m
        self.power_w = 0.0

    def ring_paths(self, frame: Any) -> Iterator[Paths]:
        """Paths of each ring; what is of the target's range and direction is added up.

        No other surface of the target's range lies in its direction: nothing is cut or added.
        """
        for ring, paths in enumerate(iter_path_chunks(frame)):
            record, _ = frame.image(ring, 0)
            grid = pixel_grid(record.receiver, record.width_px, record.height_px)
            azimuth = -np.arctan(grid.u[paths.col])  # positive to the left, as the scene is built
            elevation = np.arctan(grid.v[paths.row])
            box = np.radians(_TARGET_BOX_DEG)
            here = np.abs(azimuth - np.radians(_TARGET_AZIMUTH_DEG)) < box
            here &= np.abs(elevation) < box
            here &= (paths.range_m > _TARGET_RANGE_M[0]) & (paths.range_m < _TARGET_RANGE_M[1])
            self.power_w += float(path_power_w(paths, self._wavelength_m)[here].sum())
            yield paths


def table_paths(rows: Any, wavelength_m: float, replicate: int | None = None) -> Iterator[Paths]:
    """Yield rows of a path table as `Paths`, chunk by chunk; of one replicate if it is given."""
    area_m2 = effective_area_m2(wavelength_m)
    for start in range(0, len(rows), _CHUNK):
        part = rows[start : start + _CHUNK]
        if replicate is not None:
            part = part[part["replicate"] == replicate]
        yield make_paths(part["power_w"] / area_m2, part["length_m"])


def spread_paths(rows: Any, record: contract.PathsRecord, radar: Radar) -> Iterator[Paths]:
    """Rows as `radarsim process` takes them for the expected profile, spread over their pixels."""
    area_m2 = effective_area_m2(radar.waveform.wavelength_m)
    for views in tiles_by_replicate(rows, record.replicates):
        for view in views:
            steps = steps_of(view, record.receiver, record.replicates)
            for part in spread(view, steps, radar.waveform.sample_spacing_m / 2, np.inf):
                power = view["power_w"][part.row] * part.share
                yield make_paths(power / area_m2, part.length_m)


def table_sum(rows: Any, column: str, number: int) -> float:
    """Sum of a column over the paths that end on one object."""
    total = 0.0
    for start in range(0, len(rows), _CHUNK):
        part = rows[start : start + _CHUNK]
        total += float(part[column][part["last_object"] == number].sum())
    return total


def range_profile(paths: Iterable[Paths], radar: Radar) -> Real:
    """Expected power at the range bins (one a sample of the echo) [W]."""
    oversample = 4
    profile = expected_power_profile(paths, radar, range_limits_m=WINDOW_M, oversample=oversample)
    return np.asarray(profile.power[::oversample])


def relative_l2(profile: Real, reference: Real) -> float:
    """|profile - reference| / |reference|, both over all range bins."""
    return float(np.linalg.norm(profile - reference) / np.linalg.norm(reference))


def decibel_error(power: float, reference: float) -> float:
    """Difference of two powers [dB]; -inf becomes -999 so that JSON can hold it."""
    return float(10 * np.log10(power / reference)) if power > 0 else -999.0
