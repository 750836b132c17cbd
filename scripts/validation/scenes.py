# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with known echoes, and the program's own measurement of them.

The radar stands at the origin and looks along +Y, +Z up. Geometry is given in metres and float64;
`metres_per_unit` says what Blender makes of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon import contract
from radarsim_addon.arrays import Real
from radarsim_addon.blender.scene import active_radar
from radarsim_addon.blender.scene.rig import EMITTER_NAME
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal.paths.table import open_table
from radarsim_addon.typed_json import read_record

from .case import Bench

CARRIER_HZ = 5.3e9
EIRP_W = 1e6


def wavelength(carrier_hz: float = CARRIER_HZ) -> float:
    """Of a carrier [m]."""
    return SPEED_OF_LIGHT_MPS / carrier_hz


def new_scene(
    fov_deg: float,
    *,
    eirp_w: float = EIRP_W,
    metres_per_unit: float = 1.0,
    transmitter_m: Sequence[float] | None = None,
) -> Any:
    """An empty scene with a radar; the transmitter elsewhere if told so."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    rig = radarsim.add_radar(field_of_view_deg=fov_deg, preset="paper")
    scene.unit_settings.system = "METRIC"
    scene.unit_settings.scale_length = metres_per_unit
    emitter = bpy.data.objects[EMITTER_NAME]
    emitter.data.energy = eirp_w
    if transmitter_m is not None:
        emitter.parent = None
        rig.radarsim.light = emitter
        emitter.location = [c / metres_per_unit for c in transmitter_m]
    return scene


def metres_per_unit() -> float:
    """Of the current scene."""
    return float(bpy.context.scene.unit_settings.scale_length)


@dataclass(frozen=True)
class Plate:
    """A parallelogram: centre and two edge vectors [m]; its normal is u x v."""

    centre_m: Real
    u_m: Real
    v_m: Real

    @property
    def normal(self) -> Real:
        """Unit normal."""
        across = np.cross(self.u_m, self.v_m)
        return np.asarray(across / np.linalg.norm(across))

    @property
    def area_m2(self) -> float:
        """Area."""
        return float(np.linalg.norm(np.cross(self.u_m, self.v_m)))

    def nodes(self, count: int = 24) -> tuple[Real, Real]:
        """Gauss-Legendre points (n, 3) [m] and weights (n,) [m^2] over the plate."""
        x, w = np.polynomial.legendre.leggauss(count)
        a, b = np.meshgrid(x / 2, x / 2, indexing="ij")
        weights = np.outer(w, w).ravel() * (self.area_m2 / 4)
        points = self.centre_m + a.reshape(-1, 1) * self.u_m + b.reshape(-1, 1) * self.v_m
        return points, weights


def facing_plate(
    centre_m: Sequence[float], size_m: float, tilt_deg: float = 0.0, spin_deg: float = 27.0
) -> Plate:
    """A square whose normal points back to the radar (-Y), tilted back about X.

    It is turned in its own plane by `spin_deg`, so that its edges do not run along the pixels and
    whole rows of them are not gained or lost at once.
    """
    spin, tilt = math.radians(spin_deg), math.radians(tilt_deg)
    right = np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, math.sin(tilt), math.cos(tilt)])
    u = size_m * (math.cos(spin) * right + math.sin(spin) * up)
    v = size_m * (math.cos(spin) * up - math.sin(spin) * right)
    return Plate(np.asarray(centre_m, dtype=np.float64), u, v)


def add_plate(name: str, plate: Plate, material: Any) -> Any:
    """The plate as a mesh about its own origin, where float32 is finest."""
    unit = metres_per_unit()
    half_u, half_v = plate.u_m / (2 * unit), plate.v_m / (2 * unit)
    corners = [-half_u - half_v, half_u - half_v, half_u + half_v, -half_u + half_v]
    return add_mesh(name, [tuple(c) for c in corners], [(0, 1, 2, 3)], material, plate.centre_m)


def add_box(name: str, low_m: Sequence[float], high_m: Sequence[float], material: Any) -> Any:
    """Closed box between two corners, normals outwards."""
    low, high = np.asarray(low_m, dtype=np.float64), np.asarray(high_m, dtype=np.float64)
    half = (high - low) / (2 * metres_per_unit())
    signs = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
    corners = [tuple(half * sign) for sign in signs]
    faces = [(2, 3, 1, 0), (4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    return add_mesh(name, corners, faces, material, (low + high) / 2)


def add_wall(
    name: str,
    centre_m: Sequence[float],
    thickness_m: float,
    angle_deg: float,
    material: Any,
    half_m: float = 8.0,
) -> Real:
    """A closed box across +Y, turned about Z by an angle; returns the normal of its faces."""
    half = (half_m, thickness_m / 2, half_m)
    item = add_box(name, [-h for h in half], half, material)
    angle = math.radians(angle_deg)
    item.location = np.asarray(centre_m, dtype=np.float64) / metres_per_unit()
    item.rotation_euler = (0.0, 0.0, angle)
    return np.array([-math.sin(angle), math.cos(angle), 0.0])


def add_sphere(
    name: str, centre_m: Sequence[float], radius_m: float, material: Any, subdivisions: int = 6
) -> Any:
    """Icosphere with smooth normals."""
    import bmesh

    shape = bmesh.new()
    bmesh.ops.create_icosphere(
        shape, subdivisions=subdivisions, radius=radius_m / metres_per_unit()
    )
    mesh = bpy.data.meshes.new(name)
    shape.to_mesh(mesh)
    shape.free()
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return _link(name, mesh, material, centre_m)


def add_mesh(
    name: str,
    corners: Sequence[Any],
    faces: Sequence[tuple[int, ...]],
    material: Any,
    centre_m: Any = (0.0, 0.0, 0.0),
) -> Any:
    """A mesh of corners [Blender units] about a centre [m]."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], list(faces))
    return _link(name, mesh, material, centre_m)


def _link(name: str, mesh: Any, material: Any, centre_m: Any) -> Any:
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    item.location = np.asarray(centre_m, dtype=np.float64) / metres_per_unit()
    bpy.context.scene.collection.objects.link(item)
    return item


# -- materials -------------------------------------------------------------------------------------


def _material(name: str) -> Any:
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    return material


def lambert(albedo: float) -> Any:
    """A plain Diffuse BSDF, not a Radar Material: the world carries the range encoding."""
    material = _material("Lambert")
    nodes = material.node_tree.nodes
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (albedo, albedo, albedo, 1.0)
    output = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    return material


def metallic(index: complex, slope: float) -> Any:
    """A plain Metallic BSDF: physical conductor, Beckmann, roughness sqrt(sqrt(2) slope)."""
    material = _material("Conductor")
    nodes = material.node_tree.nodes
    lobe = nodes.new("ShaderNodeBsdfMetallic")
    lobe.distribution = "BECKMANN"
    lobe.fresnel_type = "PHYSICAL_CONDUCTOR"
    lobe.inputs["IOR"].default_value = (index.real,) * 3
    lobe.inputs["Extinction"].default_value = (index.imag,) * 3
    lobe.inputs["Roughness"].default_value = math.sqrt(math.sqrt(2) * slope)
    output = nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(lobe.outputs[0], output.inputs["Surface"])
    return material


# -- measuring -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Acquired:
    """What a run of paths left: rows of its table, sidecar, folder."""

    rows: Any
    record: contract.PathsRecord
    folder: Any

    def power_w(self, name: str | None = None) -> tuple[float, float]:
        """Power of the paths that end on an object, or of all; and its relative standard error.

        The error comes from the scatter of the replicates.
        """
        rows = self.rows if name is None else self.of(name)
        replicates = self.record.replicates
        each = np.array(
            [rows["power_w"][rows["replicate"] == k].sum() * replicates for k in range(replicates)]
        )
        mean = float(each.mean())
        if replicates < 2 or mean == 0:
            return mean, math.nan
        return mean, float(each.std(ddof=1) / math.sqrt(replicates) / mean)

    def of(self, name: str) -> Any:
        """Rows whose last scatterer is on an object."""
        return self.rows[self.rows["last_object"] == self.record.objects.index(name) + 1]


def acquire(
    bench: Bench,
    side_px: int,
    replicates: int = 4,
    *,
    height_px: int | None = None,
    carrier_hz: float = CARRIER_HZ,
    frame: int = 1,
    pulses: int = 16,
    **values: Any,
) -> Acquired:
    """Measure the current scene, one path per pixel, from the settings to the files and back."""
    run = radarsim.measure(
        active_radar(bpy.context.scene),
        bench.fresh(),
        frames=[frame],
        width_px=side_px,
        height_px=height_px or side_px,
        replicates=replicates,
        carrier_hz=carrier_hz,
        pulses=pulses,
        **values,
    )
    place = run.path / contract.frame_dir(frame)
    record = read_record(place / contract.PATHS_FILE, contract.PathsRecord)
    return Acquired(open_table(place / record.table_file).copy(), record, run.path)
