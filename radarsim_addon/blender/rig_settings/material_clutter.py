# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields of ``material.radarsim`` for the clutter of a material: model, texture, motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy

from ...physics.clutter import CLUTTER_TABLE, clutter_models
from ...physics.clutter_statistics import MOTIONS, TEXTURES
from ..materials import clutter as cm
from ..materials.clutter_fluctuation import PREFIX as FLUCTUATION

_CLUTTER = (
    (cm.NO_CLUTTER, "None", "What medium and roughness return is all"),
    *((name, model.title, model.source) for name, model in clutter_models().items()),
    (CLUTTER_TABLE, "Table", "A CSV file over grazing angle: grazing_deg and sigma0_db"),
)
_TEXTURE_NAMES = {"none": "None", "k": "K", "lognormal": "Log-Normal", "weibull": "Weibull"}
_MOTION_NAMES = {"none": "None", "exponential": "Exponential", "gaussian": "Gaussian", "sea": "Sea"}
#: What other numbers begin with, once a kind is chosen.
_START = {
    FLUCTUATION + "texture": {
        FLUCTUATION + "texture_shape": 1.0,
        FLUCTUATION + "texture_length_m": 10.0,
    },
    FLUCTUATION + "motion": {FLUCTUATION + "motion_speed_mps": 0.1},
}


def _choice(key: str, name: str, description: str, items: tuple[tuple[str, str, str], ...]) -> Any:
    """A field for a custom property of the material, one of some names; the first if absent."""
    names = [item[0] for item in items]

    def read(settings: Any) -> int:
        value = settings.id_data.get(key, names[0])
        return names.index(value) if value in names else 0

    def write(settings: Any, number: int) -> None:
        material = settings.id_data
        material[key] = names[number]
        for other, value in _START.get(key, {}).items():
            if number and other not in material:
                material[other] = value

    return bpy.props.EnumProperty(
        name=name, description=description, items=items, get=read, set=write
    )


def clutter_fields(number: Callable[..., Any]) -> dict[str, Any]:
    """Return the fields by name; `number` makes one of a custom property that holds a number."""

    def set_path(settings: Any, value: str) -> None:
        settings.id_data[cm.PATH] = value

    parameters = {one.name: one for model in clutter_models().values() for one in model.parameters}
    return {
        "clutter": _choice(
            cm.CLUTTER, "Clutter", "Return sigma0 of a model by grazing angle, too", _CLUTTER
        ),
        "clutter_path": bpy.props.StringProperty(
            name="Table",
            subtype="FILE_PATH",
            get=lambda settings: str(settings.id_data.get(cm.PATH, "")),
            set=set_path,
            description="CSV file: grazing_deg, sigma0_db; also frequency_ghz, polarisation",
        ),
        **{
            f"clutter_{name}": number(
                cm.PARAMETER_PREFIX + name,
                {"gamma_db": "Gamma [dB]", "sea_state": "Sea State"}[name],
                one.meaning[:1].upper() + one.meaning[1:],
                default=one.default,
                min=one.minimum,
                max=one.maximum,
                precision=2,
            )
            for name, one in parameters.items()
        },
        "texture": _choice(
            FLUCTUATION + "texture",
            "Texture",
            "Vary the power of the echoes over the surface; the mean stays",
            tuple((name, _TEXTURE_NAMES[name], "") for name in TEXTURES),
        ),
        "texture_shape": number(
            FLUCTUATION + "texture_shape",
            "Shape",
            "K: order nu. Log-normal: standard deviation of ln(power). Weibull: shape, at most 1",
            default=0.0, min=0.0, max=1e3, precision=3,
        ),
        "texture_length_m": number(
            FLUCTUATION + "texture_length_m",
            "Length [m]",
            "Length over which the texture varies",
            default=0.0, min=0.0, precision=3,
        ),
        "clutter_motion": _choice(
            FLUCTUATION + "motion",
            "Motion",
            "Let the scatterers of the surface move, with a spectrum of this kind",
            tuple((name, _MOTION_NAMES[name], "") for name in MOTIONS),
        ),
        "motion_speed_mps": number(
            FLUCTUATION + "motion_speed_mps",
            "Speed [m/s]",
            "Exponential: speed by which the spectrum falls to 1/e. Else: standard deviation",
            default=0.0, min=0.0, max=100.0, precision=3,
        ),
        "motion_fraction": number(
            FLUCTUATION + "motion_fraction",
            "Fraction",
            "Exponential: part of the power that is still. Sea: part that approaches",
            default=0.0, min=0.0, max=1.0, precision=3,
        ),
    }  # fmt: skip
