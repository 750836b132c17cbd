# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a physical material: a medium of the library, and a rough surface."""

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
        """The library's model. Raises ConfigError for an unknown name."""
        path = None if self.path is None else bpy.path.abspath(self.path)
        return material_model(self.name, path)

    def index(self, carrier_hz: float, beyond_band: str = "hold") -> complex:
        """Return n + jk at the carrier. Raises ConfigError for 'refuse' outside the band."""
        return complex(self.model.index(carrier_hz, beyond_band, **self.parameters))


@dataclass(frozen=True)
class Surface:
    """Rough surface: RMS height and correlation length [m], and RMS slope; 0 if unknown."""

    rms_height_m: float = 0.0
    correlation_length_m: float = 0.0
    rms_slope: float = 0.0

    @property
    def slope(self) -> float:
        """RMS slope: sqrt(2) h/l if both are known, else the slope of the record."""
        if self.rms_height_m > 0 and self.correlation_length_m > 0:
            return float(rms_slope(self.rms_height_m, self.correlation_length_m))
        return self.rms_slope

    @property
    def correlation_length(self) -> float:
        """Correlation length [m], if unknown from h and the slope; 0 if these are unknown too."""
        if self.correlation_length_m > 0:
            return self.correlation_length_m
        if self.rms_height_m > 0 and self.rms_slope > 0:
            return math.sqrt(2) * self.rms_height_m / self.rms_slope
        return 0.0
