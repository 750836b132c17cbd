# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of sigma0 that the groups of materials read: one image, a row for each material.

See :mod:`..nodes.clutter_lobe`. Scattered lobes of slightly rough mirrors are rendered by such a
table, too.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import bpy
import numpy as np

from ...array_types import Real
from ...errors import ConfigError, RadarSimError
from ...findings import Finding, finding
from ...physics.clutter import ClutterModel
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..nodes.clutter_lobe import (
    CLUTTER_ROW,
    TABLE_NODE,
    TABLE_WIDTH,
    VANISHES_BELOW,
    table_angles_rad,
)
from ..nodes.group_search import group_input
from ..nodes.groups import KIND_PROPERTY
from ..nodes.physical_material import KIND
from ..state import SettingsRestorer
from .clutter import clutter_of
from .scattered_lobe import scattered_lobe_of

#: Mean of the three channels of the range encoding over its largest, where it is least: two of them
#: may be all but 0.
_LEAST_CODE = 1 / 3


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
        A model cannot be evaluated, or a scattered lobe cannot be used; the message names the
        material.
    """
    findings, rows, sockets = [], [], []
    for material in sorted(assigned, key=lambda one: str(one.name_full)):
        clutter, lobe = clutter_of(material), scattered_lobe_of(material)
        socket = group_input(material, CLUTTER_ROW)
        if lobe is not None and lobe.from_table:
            rows.append(lobe.table_db(SPEED_OF_LIGHT_MPS / carrier_hz))
            sockets.append(socket)
        if clutter is None:
            continue
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
