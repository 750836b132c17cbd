# SPDX-License-Identifier: GPL-3.0-or-later
"""Targets of an array as point clouds: PLY, PCD and Parquet of a frame, a ROS 2 bag of all frames.

Places are in the radar's axes, forward, left, up [m] (those of ROS, too), velocities are receding
positive [m/s]. `x`, `y`, `z` and `rcs` [dBsm] have the names of nuScenes.
"""

from __future__ import annotations

import importlib
import itertools
import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...atomic_files import make_folder, remove_file, replaced
from ...errors import ConfigError, MissingDependencyError
from ..detection import DirectedDetection
from .frame_result import FrameResult, frame_file, result_writer

if TYPE_CHECKING:
    from types import ModuleType

#: Columns of a point cloud by their names in files, and the values of a target.
_POINT_COLUMNS: dict[str, Callable[[DirectedDetection], float | None]] = {
    "x": lambda one: one.x_m,
    "y": lambda one: one.y_m,
    "z": lambda one: one.z_m,
    "velocity": lambda one: one.velocity_mps,
    "unfolded_velocity": lambda one: one.unfolded_velocity_mps,
    "snr_db": lambda one: one.snr_db,
    "rcs": lambda one: one.rcs_dbsm,
    "range": lambda one: one.range_m,
    "azimuth_deg": lambda one: one.azimuth_deg,
    "elevation_deg": lambda one: one.elevation_deg,
    "reflections": lambda one: one.reflections,
}
#: The other columns of Parquet, which also holds texts and float64.
_MORE_COLUMNS: dict[str, Callable[[DirectedDetection], object]] = {
    "world_x": lambda one: one.world_x_m,
    "world_y": lambda one: one.world_y_m,
    "world_z": lambda one: one.world_z_m,
    "true_azimuth_deg": lambda one: one.true_azimuth_deg,
    "true_elevation_deg": lambda one: one.true_elevation_deg,
    "purity": lambda one: one.purity,
    "ghost": lambda one: one.reflections > 1 if one.reflections else None,
    "object": lambda one: one.name,
}
#: Numbers that are neither texts nor of another type than the values of Python.
_PARQUET_TYPES = {"frame": "int32", "reflections": "int32", "ghost": "bool_", "object": "string"}
#: Bag of all frames, in the folder of the products: a folder of two files.
_BAG = "points_bag"
_BAG_FILES = (f"{_BAG}.mcap", "metadata.yaml")
#: FLOAT32 of sensor_msgs/msg/PointField.
_ROS_FLOAT32 = 7


def needed_package(name: str, use: str) -> ModuleType:
    """Return a package that is no dependency. MissingDependencyError: it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        package = name.partition(".")[0]
        raise MissingDependencyError(
            f"{package} is not installed; it writes {use}. Install it with 'pip install {package}',"
            " or leave this file out."
        ) from error


def check_cloud_packages(parquet: bool, ros_bag: bool) -> None:
    """Raise MissingDependencyError where a package for wanted files is missing."""
    if parquet:
        needed_package("pyarrow.parquet", "Parquet")
    if ros_bag:
        needed_package("rosbags.rosbag2", "ROS 2 bags")


def _points_of(result: FrameResult) -> list[DirectedDetection]:
    targets = [] if result.detections is None else result.detections.targets
    return [one for one in targets if isinstance(one, DirectedDetection)]


@result_writer("points", "_points.ply", "_points.pcd")
def write_points(result: FrameResult, folder: Path) -> list[Path]:
    """Write the targets of an array as PLY and PCD. Without targets, write nothing.

    float32, NaN where unknown. PLY: binary, little endian, Turk's format 1.0; PCD: version 0.7,
    binary, of the Point Cloud Library.
    """
    points = _points_of(result)
    if not points:
        return []
    rows = np.array(
        [[math.nan if (x := of(one)) is None else x for of in _POINT_COLUMNS.values()]
         for one in points], dtype="<f4",
    )  # fmt: skip
    names, count = list(_POINT_COLUMNS), len(points)
    ones = " ".join(["1"] * len(names))
    headers = {
        "ply": "ply\nformat binary_little_endian 1.0\ncomment radarsim: forward, left, up [m]\n"
        f"element vertex {count}\n"
        + "".join(f"property float {name}\n" for name in names)
        + "end_header\n",
        "pcd": "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(names)}\nSIZE {ones.replace('1', '4')}\nTYPE {ones.replace('1', 'F')}\n"
        f"COUNT {ones}\nWIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\n"
        "DATA binary\n",
    }
    files = []
    for ending, header in headers.items():
        files.append(frame_file(folder, result.frame, f"_points.{ending}"))
        with replaced(files[-1]) as temporary:
            temporary.write_bytes(header.encode("ascii") + rows.tobytes())
    return files


@result_writer("parquet", "_points.parquet")
def write_parquet(result: FrameResult, folder: Path) -> list[Path]:
    """Write the targets of an array as Parquet, null where unknown. Without targets, write nothing.

    In addition to the columns of PLY: frame, time_s, places in the scene, true angles, purity,
    ghost (more than one reflection) and object.
    """
    points = _points_of(result)
    if not points:
        return []
    parquet = needed_package("pyarrow.parquet", "Parquet")
    arrow = importlib.import_module("pyarrow")
    columns: dict[str, list[object]] = {
        "frame": [result.frame] * len(points),
        "time_s": [result.time_s] * len(points),
    }
    for name, of in itertools.chain(_POINT_COLUMNS.items(), _MORE_COLUMNS.items()):
        columns[name] = [of(one) for one in points]
    table = arrow.table(
        {
            name: arrow.array(values, type=getattr(arrow, _PARQUET_TYPES.get(name, "float64"))())
            for name, values in columns.items()
        }
    )
    path = frame_file(folder, result.frame, "_points.parquet")
    with replaced(path) as temporary:
        parquet.write_table(table, temporary)
    return [path]


def write_bag(folder: Path, frames: Sequence[tuple[int, float]]) -> Path:
    """Write the points of frames as a ROS 2 bag (MCAP), from their PCD files in a folder.

    Parameters
    ----------
    folder
        Of the products.
    frames
        Numbers of the frames and their times in the scene [s].

    Returns
    -------
    Path
        Folder of the bag. Topic ``/radar/points``, sensor_msgs/msg/PointCloud2, frame_id ``radar``;
        a frame without targets is a cloud without points.

    Raises
    ------
    MissingDependencyError
        rosbags is not installed.
    ConfigError
        A frame lies before time 0, which ROS does not know.
    """
    rosbag2 = needed_package("rosbags.rosbag2", "ROS 2 bags")
    stores = importlib.import_module("rosbags.typesys")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    kinds = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    fields = [
        kinds["PointField"](name, 4 * number, _ROS_FLOAT32, 1)
        for number, name in enumerate(_POINT_COLUMNS)
    ]
    step, bag = 4 * len(fields), make_folder(folder / _BAG)
    with tempfile.TemporaryDirectory() as other:
        plugin = rosbag2.StoragePlugin.MCAP
        with rosbag2.Writer(Path(other) / _BAG, version=8, storage_plugin=plugin) as writer:
            kind = "sensor_msgs/msg/PointCloud2"
            topic = writer.add_connection("/radar/points", kind, typestore=store)
            for number, time_s in frames:
                time_ns = round(time_s * 1e9)
                if time_ns < 0:
                    raise ConfigError(
                        f"Frame {number} is at {time_s:g} s; a ROS 2 bag begins at 0 s. Choose "
                        "frames from that time on, or write no bag."
                    )
                data = _pcd_data(frame_file(folder, number, "_points.pcd"))
                stamp = kinds["Time"](*divmod(time_ns, 10**9))
                cloud = kinds["PointCloud2"](
                    kinds["Header"](stamp, "radar"), 1, data.size // step, fields, False,
                    step, data.size, data, False,
                )  # fmt: skip
                writer.write(topic, time_ns, store.serialize_cdr(cloud, kind))
        for name in _BAG_FILES:
            with replaced(bag / name) as temporary:
                temporary.write_bytes((Path(other) / _BAG / name).read_bytes())
    return bag


def remove_bag(folder: Path) -> None:
    """Remove the bag that an earlier processing wrote."""
    for name in _BAG_FILES:
        remove_file(folder / _BAG / name)
    if (folder / _BAG).is_dir() and not any((folder / _BAG).iterdir()):
        (folder / _BAG).rmdir()


def _pcd_data(path: Path) -> NDArray[np.uint8]:
    """Return the points of a PCD file that `write_points` wrote; none without a file."""
    data = path.read_bytes().partition(b"DATA binary\n")[2] if path.is_file() else b""
    return np.frombuffer(data, np.uint8)
