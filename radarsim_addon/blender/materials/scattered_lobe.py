# SPDX-License-Identifier: GPL-3.0-or-later
"""The directive lobe in which a material scatters what it reflects and does not mirror.

The custom property ``radarsim_lobe_exponent`` of a material holds the exponent of the lobe, which
takes the place of the Lambert lobe of a simple material. A smooth physical material with an RMS
height has no other lobe: a run renders one by the table of a clutter model. The rows of the path
table are weighted, see `paths.clutter_weights`.

`set_clutter_tables` makes one image with a row for each material that renders a clutter model or
such a lobe: sigma0 by grazing angle [dB], which the groups of the materials read (see
`nodes.physical_material.add_clutter_lobe`).
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import bpy
import numpy as np

from ...arrays import Real
from ...errors import ConfigError, RadarSimError
from ...findings import Finding, finding
from ...physics.clutter import ClutterModel
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.rough import lobe_exponent
from ..nodes.groups import KIND_PROPERTY, group_input
from ..nodes.physical_material import (
    CLUTTER_ROW,
    PHYSICAL_KIND,
    TABLE_NODE,
    TABLE_WIDTH,
    VANISHES_BELOW,
    table_angles_rad,
)
from ..state import SettingsRestorer
from .clutter import clutter_of
from .surfaces import LOBE_EXPONENT, read_surface


def set_scattered_lobe(material: bpy.types.Material, exponent: int | None) -> None:
    """Make a material scatter around the direction of the mirrored wave.

    Parameters
    ----------
    material : bpy.types.Material
        Simple Radar Material with a Specularity below 1, whose Lambert lobe it replaces; or a
        physical one with an RMS height and without slope.
    exponent
        Of the lobe, 1 to 1000: per steradian, ((1 + cos psi) / 2)^exponent, psi the angle to the
        mirrored wave. (k l)^2 is near the lobe of slight roughness of the correlation length l.
        None: no directive lobe.

    Raises
    ------
    ConfigError
        Not such a material, or no such exponent. The material stays as it was.
    """
    before = material.get(LOBE_EXPONENT)
    if before is not None:
        del material[LOBE_EXPONENT]
    if exponent is None:
        return
    try:
        material[LOBE_EXPONENT] = lobe_exponent(exponent)
        read_surface(material).scattered_lobe()
    except ConfigError:
        if LOBE_EXPONENT in material.keys():
            del material[LOBE_EXPONENT]
        if before is not None:
            material[LOBE_EXPONENT] = before
        raise


# Tables of sigma0.

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

    Returns findings about materials of rendered objects (`assigned`) whose model has no effect, is
    used at a carrier outside its band, or is in part too weak to be rendered. Raises ConfigError,
    which names the material, if a model cannot be evaluated or a scattered lobe cannot be used.
    """
    findings, rows, sockets = [], [], []
    for material in sorted(assigned, key=lambda one: str(one.name_full)):
        clutter, lobe = clutter_of(material), read_surface(material).scattered_lobe()
        socket = group_input(material, CLUTTER_ROW)
        if lobe is not None and lobe.from_table:
            rows.append(lobe.rendered_db(table_angles_rad(), SPEED_OF_LIGHT_MPS / carrier_hz))
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
        node = tree.nodes.get(TABLE_NODE) if tree.get(KIND_PROPERTY) == PHYSICAL_KIND else None
        if node is not None:
            recorder.set(node, "image", image)


def _limits_of(
    material: bpy.types.Material, model: ClutterModel, carrier_hz: float, db: Real
) -> list[Finding]:
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
