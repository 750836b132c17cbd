# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are ready for use: those of the Asset Browser, and more for everyday names."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from .medium import Medium
from .physical_materials import make_physical_material


@dataclass(frozen=True)
class Asset:
    """A material of the library: a medium, and RMS height and correlation length [m].

    The surfaces are typical, not measured.
    """

    name: str
    catalogue: str
    medium: str
    rms_height_m: float = 0.0
    correlation_length_m: float = 0.0
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def description(self) -> str:
        """Tooltip in the Asset Browser: source, band, surface."""
        model = Medium(self.medium).model
        surface = "Smooth"
        if self.rms_height_m:
            surface = (
                f"RMS height {self.rms_height_m * 1e3:g} mm, correlation length "
                f"{self.correlation_length_m * 1e3:g} mm"
            )
        given = "".join(f"{key} {value:g}. " for key, value in self.parameters.items())
        return f"{model.source} ({model.edition}), {model.band_text}. {given}{surface}"

    def material(self, name: str, carrier_hz: float, **options: Any) -> Any:
        """Make the material; options as for `make_physical_material`."""
        return make_physical_material(
            name,
            self.medium,
            carrier_hz=carrier_hz,
            rms_height_m=self.rms_height_m,
            correlation_length_m=self.correlation_length_m,
            **options,
            **self.parameters,
        )


ASSETS: tuple[Asset, ...] = (
    Asset("Concrete, smooth", "Radar/Building", "concrete"),
    Asset("Concrete, rough", "Radar/Building", "concrete", 2e-3, 2e-2),
    Asset("Brick", "Radar/Building", "brick", 2e-3, 1.5e-2),
    Asset("Plasterboard", "Radar/Building", "plasterboard"),
    Asset("Wood", "Radar/Building", "wood", 0.5e-3, 1e-2),
    Asset("Chipboard", "Radar/Building", "chipboard"),
    Asset("Glass", "Radar/Building", "glass"),
    Asset("Marble", "Radar/Building", "marble"),
    Asset("Asphalt", "Radar/Ground", "asphalt_concrete", 1.5e-3, 8e-3),
    Asset("Very dry ground", "Radar/Ground", "very_dry_ground", 1e-2, 8e-2),
    Asset("Medium dry ground", "Radar/Ground", "medium_dry_ground", 1e-2, 8e-2),
    Asset("Wet ground", "Radar/Ground", "wet_ground", 1e-2, 8e-2),
    Asset("Soil, 20 % moisture", "Radar/Ground", "soil", 1e-2, 8e-2, {"moisture": 0.2}),
    Asset("Ice", "Radar/Water", "ice", 2e-3, 5e-2),
    Asset("Fresh water", "Radar/Water", "water", 5e-3, 1e-1),
    Asset("Sea water", "Radar/Water", "sea_water", 1e-2, 1e-1),
    Asset("Steel", "Radar/Metal", "conductor", 0, 0, {"conductivity_s_per_m": 1.45e6}),
    Asset("Aluminium", "Radar/Metal", "conductor", 0, 0, {"conductivity_s_per_m": 3.8e7}),
    Asset("Metal, rough", "Radar/Metal", "metal", 2e-3, 1e-2),
)

_SKIN = {
    # Dry skin after Gabriel (1996) above 1 GHz: its first dispersion and what the second leaves.
    "static_permittivity": 36.0,
    "infinite_permittivity": 4.0,
    "relaxation_frequency_hz": 22e9,
    "conductivity_s_per_m": 1.0,
}
#: Materials by name: those of the Asset Browser, and others whose index is typical, not measured.
READY: dict[str, Asset] = {
    asset.name: asset
    for asset in (
        *ASSETS,
        Asset("Skin", "", "debye", 0.3e-3, 3e-3, _SKIN),
        Asset("Rubber", "", "permittivity", 0.5e-3, 4e-3, {"eps_real": 4.0, "eps_imag": 0.4}),
        Asset("Plastic", "", "permittivity", 0.1e-3, 2e-3, {"eps_real": 2.6, "eps_imag": 0.02}),
        Asset("Cloth", "", "permittivity", 0.5e-3, 4e-3, {"eps_real": 1.7, "eps_imag": 0.05}),
        Asset("Leaves", "", "permittivity", 0.5e-3, 5e-3, {"eps_real": 15.0, "eps_imag": 6.0}),
    )
}
#: Words in the names of materials, and the material they stand for; the first that fits counts.
_WORDS: tuple[tuple[str, str], ...] = (
    ("Rubber", "rubber tyre tire wheel"),
    ("Asphalt", "asphalt tarmac bitumen road street"),
    ("Glass", "glass window windshield windscreen pane"),
    ("Metal, rough", "metal steel iron aluminium aluminum alu chrome copper brass bronze tin zinc"),
    ("Metal, rough", "gold silver carpaint paint rim chassis rail guardrail"),
    ("Brick", "brick masonry"),
    ("Concrete, rough", "concrete cement beton pavement sidewalk kerb curb facade wall"),
    ("Plasterboard", "plaster plasterboard drywall gypsum stucco"),
    ("Wood", "wood wooden oak pine plank timber bark trunk parquet"),
    ("Skin", "skin face hand head human flesh"),
    ("Leaves", "leaf leaves foliage plant hedge bush"),
    ("Cloth", "cloth fabric textile cotton leather shirt jeans trousers carpet curtain"),
    ("Plastic", "plastic pvc polymer nylon acrylic vinyl"),
    ("Very dry ground", "sand desert"),
    ("Medium dry ground", "ground soil dirt earth mud grass lawn gravel terrain field"),
    ("Sea water", "sea ocean"),
    ("Fresh water", "water river lake puddle"),
    ("Ice", "ice snow"),
    ("Marble", "marble stone granite rock"),
)  # fmt: skip
#: Letters from which a word also counts as the beginning of a longer one: "metallic" is metal,
#: "headlight" no skin.
_WITHIN = 5


def suggest_material(*names: str) -> str | None:
    """Return the ready material that names stand for, the first name first; None: not known."""
    for name in names:
        words = re.findall("[a-z]+", re.sub("([a-z])([A-Z])", r"\1 \2", name).lower())
        for ready, known in _WORDS:
            for word in known.split():
                if any(
                    part in (word, f"{word}s") or (len(word) >= _WITHIN and part.startswith(word))
                    for part in words
                ):
                    return ready
    return None
