# SPDX-License-Identifier: GPL-3.0-or-later
"""Clutter models of materials: sigma0 by grazing angle, next to the lobes of medium and surface.

The user's values are custom properties of a physical material:

=================================  =================================================================
``radarsim_clutter``               name of the model in `physics.clutter` ("nrl_sea", "table"...)
``radarsim_clutter_<parameter>``   parameters of the model, by name
``radarsim_clutter_path``          CSV file of the model "table"
=================================  =================================================================

A run evaluates the models at its carrier and polarisation into one image, a row for each, which the
material's group reads; see :mod:`..nodes.clutter_lobe`.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import ArrayLike

from ...array_types import Real
from ...errors import ConfigError, RadarSimError
from ...findings import Finding, finding
from ...physics.clutter import CLUTTER_TABLE, ClutterModel, clutter_model
from ...physics.materials import TABLE
from ..nodes.clutter_lobe import (
    CLUTTER_ROW,
    TABLE_NODE,
    TABLE_WIDTH,
    VANISHES_BELOW,
    table_angles_rad,
)
from ..nodes.group_search import group_input, group_node
from ..nodes.groups import KIND_PROPERTY
from ..nodes.physical_material import KIND
from ..state import SettingsRestorer
from .physical_materials import MEDIUM
from .physical_materials import PATH as MEDIUM_PATH

CLUTTER = "radarsim_clutter"
PARAMETER_PREFIX = "radarsim_clutter_"
PATH = "radarsim_clutter_path"
NO_CLUTTER = "none"

#: Mean of the three channels of the range encoding over its largest, where it is least: two of them
#: may be all but 0.
_LEAST_CODE = 1 / 3


@dataclass(frozen=True)
class Clutter:
    """A clutter model with its parameters; `path` is the CSV file of the model 'table'."""

    name: str
    parameters: dict[str, float] = field(default_factory=dict)
    path: str | None = None

    @property
    def model(self) -> ClutterModel:
        """The model. Raises ConfigError for an unknown name or a table that cannot be used."""
        if not self.path:
            return clutter_model(self.name, self.path)
        path = bpy.path.abspath(self.path)
        return _table_model(self.name, path, _stamp(path))

    def sigma0_db(self, carrier_hz: float, grazing_rad: ArrayLike, polarisation: str) -> Real:
        """Return sigma0 at grazing angles [rad] in dB. Raises ConfigError as its model does."""
        return self.model.sigma0_db(carrier_hz, grazing_rad, polarisation, **self.parameters)


@functools.lru_cache(maxsize=16)
def _table_model(name: str, path: str, _stamp: tuple[int, int] | None) -> ClutterModel:
    """Model of a file, read again only after the file has changed: panels ask at each redraw."""
    return clutter_model(name, path)


def _stamp(path: str) -> tuple[int, int] | None:
    """Time of the last change [ns] and size of a file; None without it."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size


def clutter_key(clutter: Clutter) -> str:
    """Return a text that changes whenever sigma0 of a clutter model may.

    Parameters
    ----------
    clutter
        Model with its parameters or file.

    Returns
    -------
    str
    """
    stamp = _stamp(bpy.path.abspath(clutter.path)) if clutter.path else None
    return f"{clutter!r} {stamp}"


def clutter_of(material: Any) -> Clutter | None:
    """Return the clutter model of a material.

    Parameters
    ----------
    material : bpy.types.Material or None

    Returns
    -------
    Clutter or None
        None without a model.

    Raises
    ------
    ConfigError
        An unknown model.
    """
    name = None if material is None else material.get(CLUTTER)
    if not isinstance(name, str) or name in ("", NO_CLUTTER):
        return None
    if name == CLUTTER_TABLE:
        return Clutter(name, {}, str(material.get(PATH, "")))
    try:
        known = clutter_model(name).parameters
    except ConfigError as error:
        raise ConfigError(f"Material {material.name!r}: {error}") from error
    given = {one.name: material.get(PARAMETER_PREFIX + one.name) for one in known}
    return Clutter(name, {key: float(value) for key, value in given.items() if value is not None})


def clutter_name(materials: Iterable[Any]) -> str | None:
    """Return the name of the clutter model of the first of some materials that renders one.

    Parameters
    ----------
    materials : iterable of bpy.types.Material or None
        Of an object, by slot.

    Returns
    -------
    str or None

    Raises
    ------
    ConfigError
        An unknown model.
    """
    for material in materials:
        clutter = clutter_of(material)
        if clutter is not None and group_input(material, CLUTTER_ROW) is not None:
            return clutter.name
    return None


def table_files(material: Any) -> list[Path]:
    """Return the CSV files that a material takes its medium and its clutter from.

    Parameters
    ----------
    material : bpy.types.Material

    Returns
    -------
    list of Path
    """
    keys = ((MEDIUM, TABLE, MEDIUM_PATH), (CLUTTER, CLUTTER_TABLE, PATH))
    names = [material.get(path) for key, table, path in keys if material.get(key) == table]
    return [Path(bpy.path.abspath(name)) for name in names if isinstance(name, str) and name]


def set_clutter(material: Any, name: str, *, path: str | None = None, **parameters: float) -> None:
    """Give a physical material a clutter model.

    Parameters
    ----------
    material : bpy.types.Material
        Of the physical Radar Material group.
    name
        Key of `physics.clutter.clutter_models`, 'table' together with `path`, or 'none'.
    path
        CSV file, for 'table' only.
    **parameters
        Values of the model's ``parameters`` by name.

    Raises
    ------
    ConfigError
        Not such a material, an unknown model or parameter, a number out of range, or a table that
        cannot be used. The material stays as it was.
    """
    node = group_node(material)
    if node is None or node.node_tree.get(KIND_PROPERTY) != KIND:
        raise ConfigError(
            f"Material {material.name!r} has no physical Radar Material at its output, which a "
            "clutter model needs. Choose Use Physical Inputs in the Material tab, without a "
            "thickness of a thin sheet."
        )
    if name != NO_CLUTTER:
        Clutter(name, parameters, path).sigma0_db(1e9, 0.1, "average")
    for key in [key for key in material.keys() if key.startswith(PARAMETER_PREFIX)]:
        del material[key]
    material[CLUTTER] = name
    if path is not None:
        material[PATH] = path
    for key, value in parameters.items():
        material[PARAMETER_PREFIX + key] = float(value)


def set_clutter_tables(
    recorder: SettingsRestorer,
    assigned: Collection[Any],
    carrier_hz: float,
    polarisation: str,
) -> list[Finding]:
    """Give the groups of materials their tables of sigma0, until the recorder takes them back.

    Parameters
    ----------
    recorder
        Records the changes.
    assigned
        Materials of rendered objects.
    carrier_hz
        Carrier [Hz].
    polarisation
        That of the run.

    Returns
    -------
    list of Finding
        Of materials whose model has no effect, is used at a carrier outside its band, or is in part
        too weak to be rendered.

    Raises
    ------
    ConfigError
        A model cannot be evaluated; the message names the material.
    """
    findings, rows, sockets = [], [], []
    for material in sorted(assigned, key=lambda one: str(one.name_full)):
        clutter = clutter_of(material)
        if clutter is None:
            continue
        socket = group_input(material, CLUTTER_ROW)
        if socket is None:
            findings.append(finding("clutter-not-connected", material.name))
            continue
        try:
            db = clutter.sigma0_db(carrier_hz, table_angles_rad(), polarisation)
            findings += _limits_of(material, clutter.model, carrier_hz, db)
        except RadarSimError as error:
            raise ConfigError(f"Material {material.name!r}: {error}") from error
        rows.append(db)
        sockets.append(socket)
    if rows:
        _set_image(recorder, np.array(rows, dtype=np.float32))
        for number, socket in enumerate(sockets):
            recorder.set(socket, "default_value", (number + 0.5) / len(rows))
    return findings


def _set_image(recorder: SettingsRestorer, rows_db: np.ndarray[Any, np.dtype[np.float32]]) -> None:
    """Make the image of all tables, (rows, TABLE_WIDTH) [dB], and give it to all groups."""
    image = bpy.data.images.new(
        "Radar Clutter Tables", TABLE_WIDTH, len(rows_db), float_buffer=True, is_data=True
    )
    recorder.on_restore("clutter tables", lambda: bpy.data.images.remove(image))
    pixels = np.ones((*rows_db.shape, 4), dtype=np.float32)
    pixels[..., :3] = rows_db[..., None]
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    for tree in bpy.data.node_groups:
        node = tree.nodes.get(TABLE_NODE) if tree.get(KIND_PROPERTY) == KIND else None
        if node is not None:
            recorder.set(node, "image", image)


def _limits_of(material: Any, model: ClutterModel, carrier_hz: float, db: Real) -> list[Finding]:
    """Find where a model does not hold at a carrier, and where its lobe is lost."""
    found, grazing_rad = [], table_angles_rad()
    if not model.is_valid(carrier_hz, model.grazing_rad[0]):
        low_hz, high_hz = model.band_hz
        found.append(
            finding(
                "clutter-beyond-band",
                material.name,
                carrier_hz=carrier_hz,
                model=model.name,
                low_hz=low_hz,
                high_hz=high_hz,
            )
        )
    albedo = 10 ** (db / 10) / (4 * np.sin(grazing_rad) ** 2)
    lost = (albedo < VANISHES_BELOW / _LEAST_CODE) & model.is_valid(model.band_hz[0], grazing_rad)
    if lost.any():
        first = int(np.argmax(lost))
        found.append(
            finding(
                "clutter-too-weak",
                material.name,
                grazing_deg=float(np.degrees(grazing_rad[first])),
                sigma0_db=float(db[first]),
            )
        )
    return found
