# SPDX-License-Identifier: GPL-3.0-or-later
"""What a physical material is made of: a medium of the library, and a rough surface."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import bpy

from ...physics.material_model import MaterialModel
from ...physics.materials import material_model
from ...physics.rough import rms_slope


@dataclass(frozen=True)
class Medium:
    """A model of the library with its parameters; `path` is the CSV file of the model 'table'."""

    name: str
    parameters: dict[str, float] = field(default_factory=dict)
    path: str | None = None

    @property
    def model(self) -> MaterialModel:
        """The library's model. ConfigError where there is none of that name."""
        path = None if self.path is None else bpy.path.abspath(self.path)
        return material_model(self.name, path)

    def index(self, carrier_hz: float) -> complex:
        """n + jk at the carrier; ConfigError outside the band of validity, which it names."""
        return complex(self.model.index(carrier_hz, **self.parameters))


@dataclass(frozen=True)
class Surface:
    """Rough surface: rms height and correlation length [m], 0 where not given; rms slope."""

    rms_height_m: float = 0.0
    correlation_length_m: float = 0.0
    rms_slope: float = 0.0

    @property
    def slope(self) -> float:
        """sqrt(2) h/l where both are given, else the slope that is."""
        if self.rms_height_m > 0 and self.correlation_length_m > 0:
            return float(rms_slope(self.rms_height_m, self.correlation_length_m))
        return self.rms_slope

    @property
    def correlation_length(self) -> float:
        """l [m], from h and the slope where it was not given; 0 where neither says."""
        if self.correlation_length_m > 0:
            return self.correlation_length_m
        if self.rms_height_m > 0 and self.rms_slope > 0:
            return math.sqrt(2) * self.rms_height_m / self.rms_slope
        return 0.0
