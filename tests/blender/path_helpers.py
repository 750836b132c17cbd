# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of the acquisition "paths" for tests: small scenes, the table and its sidecar."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from radarsim_addon import contract
from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import PathJob
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.physics.radar_equation import effective_area_m2
from radarsim_addon.signal.paths import PathRows, open_table
from radarsim_addon.typed_json import read_record
from tests.blender import radar_scenes as rs

C0_MPS = 299_792_458.0


@dataclass
class PathRun:
    """What a run left: its job, and per frame the table and the sidecar."""

    job: PathJob
    folder: Path

    def table(self, frame: int = 1) -> PathRows:
        """Rows of a frame, in memory."""
        return open_table(self.folder / contract.frame_dir(frame) / contract.PATHS_TABLE).copy()

    def record(self, frame: int = 1) -> contract.PathsRecord:
        """Sidecar of a frame."""
        folder = self.folder / contract.frame_dir(frame)
        return read_record(folder / contract.PATHS_FILE, contract.PathsRecord)


def job_for(
    folder: Path,
    *,
    overwrite: bool = False,
    identity: str = "",
    options: dict[str, Any] | None = None,
    **changes: Any,
) -> PathJob:
    """A job over the current scene, which resumes a run of the same `identity`."""
    scene = bpy.context.scene
    path_options = PathOptions(**{"replicates": 1, **(options or {})})
    measured = rs.measurement(**changes)
    job = PathJob(scene, scene.view_layers[0], measured, folder, path_options, overwrite=overwrite)
    job.identity = identity
    return job


def run_paths(folder: Path, *, limit: int | None = None, **changes: Any) -> PathRun:
    """Measure the current scene; stop after `limit` renders if given."""
    with job_for(folder, **changes) as job:
        for count, task in enumerate(job.pending()):
            if count == limit:
                break
            job.start(task)
            job.render(task)
            job.finish(task)
    assert job.unrestored == []
    return PathRun(job, folder)


def radiance(rows: PathRows, carrier_hz: float = 5.3e9, replicates: int = 1) -> np.ndarray:
    """Radiance of each row, W/(m^2 sr): what the row's power says of its solid angle."""
    area = effective_area_m2(C0_MPS / carrier_hz)
    return rows["power_w"] / rows["solid_angle_sr"] / area


def principled(name: str, colour: tuple[float, float, float], roughness: float = 0.7) -> Any:
    """A foreign material: Principled as Blender makes it."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    node = next(n for n in material.node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    node.inputs["Base Color"].default_value = (*colour, 1.0)
    node.inputs["Roughness"].default_value = roughness
    return material


def shader_material(name: str, *closures: tuple[str, dict[str, Any]]) -> Any:
    """A material that adds closures, each by node type and inputs."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = None
    for kind, inputs in closures:
        node = tree.nodes.new(kind)
        for key, value in inputs.items():
            node.inputs[key].default_value = value
        if shader is None:
            shader = node.outputs[0]
        else:
            both = tree.nodes.new("ShaderNodeAddShader")
            tree.links.new(shader, both.inputs[0])
            tree.links.new(node.outputs[0], both.inputs[1])
            shader = both.outputs[0]
    tree.links.new(shader, tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def grey(value: float) -> tuple[float, float, float, float]:
    """A shader colour."""
    return (value, value, value, 1.0)


def lambert(albedo: float, name: str = "Lambert") -> Any:
    """Diffuse material that is not a Radar Material."""
    return shader_material(name, ("ShaderNodeBsdfDiffuse", {"Color": grey(albedo)}))


def half_transparent(transmission: float, name: str = "Half") -> Any:
    """Diffuse and transparent, shares that add up to one; lobes are left to chance."""
    return shader_material(
        name,
        ("ShaderNodeBsdfDiffuse", {"Color": grey(1 - transmission)}),
        ("ShaderNodeBsdfTransparent", {"Color": grey(transmission)}),
    )


def rough_metal() -> Any:
    """Radar Material that reflects 99.98 %, as a Lambert surface."""
    return nodes.make_material("Rough metal", 1e4, 1e4, 0.0, 0.5, penetrable=False)


def bare_sheet(n: float, specularity: float, roughness: float) -> Any:
    """Radar Material of a face alone: a part F of the power is reflected, 1 - F goes through."""
    material = nodes.make_material("Sheet", n, 0.0, specularity, roughness, penetrable=False)
    tree = material.node_tree
    group = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeGroup")
    one = tree.nodes.new("ShaderNodeValue")
    one.outputs[0].default_value = 1.0  # linked: a run does not close it
    tree.links.new(one.outputs[0], group.inputs["Transmission"])
    return material


def mirror(name: str = "Mirror") -> Any:
    """Radar Material that reflects 99.98 % and does not scatter."""
    return nodes.make_material(name, 1e4, 1e4, 1.0, 0.0, penetrable=False)


def irradiance(range_m: np.ndarray) -> np.ndarray:
    """Of the rig's transmitter at a distance from it, W/m^2."""
    return rs.EIRP_W / (4 * np.pi * range_m**2)


def plate_at(y: float, size: float, material: Any, tilt_deg: float = 0.0) -> Any:
    """A plate across the boresight (+Y) with any material."""
    plate = rs.add_plate(y, size, tilt_deg, preset=None)
    plate.data.materials.append(material)
    return plate


def quad(name: str, corners: list[tuple[float, float, float]], material: Any) -> Any:
    """One quadrilateral by its corners in world space."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.materials.append(material)
    item = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def field_of_view(degrees: float) -> None:
    """Set the receiver's field of view."""
    bpy.context.scene.camera.data.angle = math.radians(degrees)


def radar_at(location: tuple[float, float, float]) -> Any:
    """Move the radar; returns the empty."""
    empty = bpy.data.objects["Radar"]
    empty.location = location
    return empty
