# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical materials: a medium of the library and a rough surface, stored in the material.

The user's values are custom properties of the material, in SI units and float64. They are available
in each Blender, with and without the add-on, and survive saving and appending:

=================================  =================================================================
``radarsim_medium``                name of the model in `physics.materials` ("concrete", "index"...)
``radarsim_medium_<parameter>``    parameters of the model, by name
``radarsim_medium_path``           CSV file of the model "table"
``radarsim_rms_height_m``          RMS height h of the surface [m]
``radarsim_correlation_length_m``  correlation length l of a Gaussian surface [m]
``radarsim_rms_slope``             RMS slope m, if h and l do not give it by m = sqrt(2) h/l
``radarsim_sheet_thickness_m``     thickness of a thin pane that is modelled as one face [m]
=================================  =================================================================

Any material can have the three properties of the surface; `rough_surface_of` reads them.
`update_material` computes the index n + jk at the carrier from the medium when the carrier changes
and when a run starts. `beyond_band` says what a medium does outside its band, see
`MaterialModel.index`.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import starmap
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import bpy
import numpy as np

from ...errors import ConfigError, RadarSimError
from ...findings import Finding, finding
from ...physics.checks import real_array
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.materials import TABLE, MaterialModel, material_model
from ...physics.rough import (
    cycles_roughness,
    kirchhoff_limits,
    slope_from_roughness,
    transmission_factors,
)
from ...signal.scene import RoughSurface, is_conductor
from ..nodes.groups import (
    ensure_group,
    find_group,
    group_input,
    group_kind,
    group_node,
    holds_group,
    input_number,
    set_input,
)
from ..nodes.materials import link_group
from ..nodes.physical_material import (
    GRAZING_TRANSMISSION,
    PHYSICAL_KIND,
    SHEET_KIND,
    THICKNESS,
)
from ..nodes.radar_material import EXTINCTION, INDEX, ROUGHNESS, TRANSMISSION
from ..state import (
    SettingsRestorer,
    Shape,
    Snapshot,
    mesh_counts,
    slot_materials,
)

#: Object types whose surface Cycles shades by material slots.
SURFACE_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD"}


class MaterialAssignment(NamedTuple):
    """An original object with the original materials of its slots, None for an empty one.

    Materials of instances that it makes follow.
    """

    item: bpy.types.Object
    materials: tuple[Any, ...]


#: By snapshot, hidden objects too.
_of_snapshots: WeakKeyDictionary[Snapshot, list[MaterialAssignment]] = WeakKeyDictionary()


def assigned_materials(snapshot: Snapshot) -> list[MaterialAssignment]:
    """Return the materials of each rendered object with a surface, in the order of the snapshot.

    A material may be in a slot of the mesh or of the object, or be set by Geometry Nodes. The
    object may be linked, overridden, or a member of an instanced collection that is in no scene.
    The slots of the evaluated object have all of these.
    """
    if snapshot not in _of_snapshots:
        # Instances that Geometry Nodes make have slots of their own. They come after the object's,
        # whose places stay.
        found: dict[Any, tuple[Any, ...]] = {}
        for shape in snapshot.shapes:
            if shape.original.type in SURFACE_TYPES:
                known = found.setdefault(shape.original, shape.materials)
                more = (one for one in shape.materials if one and one not in known)
                found[shape.original] = (*known, *dict.fromkeys(more))
        _of_snapshots[snapshot] = list(starmap(MaterialAssignment, found.items()))
    return [one for one in _of_snapshots[snapshot] if not one.item.hide_render]


def foreign_objects(snapshot: Snapshot, is_known: Callable[[Any], bool]) -> Iterator[Any]:
    """Yield rendered objects with faces of a material that is not known, or of none (None).

    Faces decide, not slots: an object that only holds instances has none, and Set Material of
    Geometry Nodes leaves an empty slot that no face uses.
    """
    snapshot, is_known = snapshot, cache(is_known)
    for shape in snapshot.shapes:
        original, slots = shape.original, shape.materials or (None,)
        if original.type not in SURFACE_TYPES or original.hide_render or all(map(is_known, slots)):
            continue
        if not all(is_known(slots[index]) for index in _used_slots(snapshot, shape, len(slots))):
            yield original


def _used_slots(snapshot: Snapshot, shape: Shape, count: int) -> list[int]:
    """Return the slots that faces use; all of hair curves and point clouds, which have no mesh."""
    if shape.kind in {"CURVES", "POINTCLOUD"}:
        return list(range(count))
    mesh = snapshot.mesh(shape)
    found = () if mesh is None else mesh.slots
    used: list[int] = np.unique(np.clip(found, 0, count - 1)).astype(int).tolist()
    return used


def has_no_faces(item: bpy.types.Object) -> bool:
    """Return whether an object is a mesh of points or edges, to which modifiers add no faces."""
    return bool(item.type == "MESH" and not item.modifiers and not mesh_counts(item.data)[-1])


# Parts of a physical material.


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


MEDIUM = "radarsim_medium"
PARAMETER_PREFIX = "radarsim_medium_"
PATH = "radarsim_medium_path"
RMS_HEIGHT = "radarsim_rms_height_m"
CORRELATION_LENGTH = "radarsim_correlation_length_m"
RMS_SLOPE = "radarsim_rms_slope"
SHEET_THICKNESS = "radarsim_sheet_thickness_m"

EXACT_FACETS = bpy.app.version >= (5, 0, 0)
"""Whether Cycles evaluates Fresnel's equations at each facet; see `ATTR_FACET_FRESNEL`."""


def medium_of(material: bpy.types.Material) -> Medium | None:
    """Return the medium of a material; None for a simple or foreign one."""
    name = material.get(MEDIUM)
    if not isinstance(name, str) or not name:
        return None
    if name == TABLE:
        return Medium(name, {}, str(material.get(PATH, "")))
    parameters = {}
    for parameter in material_model(name).parameters:
        value = material.get(PARAMETER_PREFIX + parameter.name)
        if value is not None:
            parameters[parameter.name] = float(value)
    return Medium(name, parameters)


def rough_surface_of(material: bpy.types.Material) -> RoughSurface:
    """Return the heights of a material's surface, zeros without any of the three properties.

    Without a slope, that of the Roughness of a Radar Material is used.
    """
    rough = RoughSurface(
        *(float(material.get(key, 0.0)) for key in (RMS_HEIGHT, CORRELATION_LENGTH, RMS_SLOPE))
    )
    found = None
    if rough != RoughSurface() and rough.slope == 0:
        found = find_group(material)
    roughness = None if found is None else input_number(found, ROUGHNESS)
    if roughness is None:
        return rough
    return replace(rough, rms_slope=float(slope_from_roughness(roughness)))


def is_physical(material: bpy.types.Material) -> bool:
    """Return whether a material has one of the physical groups: the material's, or the sheet's."""
    return group_kind(material) in (PHYSICAL_KIND, SHEET_KIND)


def is_sheet(material: bpy.types.Material) -> bool:
    return group_kind(material) == SHEET_KIND


def make_physical_material(
    name: str,
    medium: str,
    *,
    carrier_hz: float,
    rms_height_m: float = 0.0,
    correlation_length_m: float = 0.0,
    rms_slope: float = 0.0,
    path: str | None = None,
    penetrable: bool | None = None,
    sheet_thickness_m: float = 0.0,
    **parameters: float,
) -> Any:
    """Make a material from a medium of the library and a rough or smooth surface.

    `medium`, `path` and `parameters` are those of `physics.materials.material`. The first
    evaluation is at `carrier_hz`; a run evaluates the medium at its own carrier. A surface of zeros
    is smooth. `penetrable` links the interior; None: unless the medium is a conductor at this
    carrier. `sheet_thickness_m` above 0 makes a thin pane of smooth faces, modelled as one face
    with interference.

    Raises ConfigError for an unknown medium or parameter, a carrier outside the band, or a slope
    that is too steep.
    """
    numbers = {
        RMS_HEIGHT: rms_height_m,
        CORRELATION_LENGTH: correlation_length_m,
        RMS_SLOPE: rms_slope,
        SHEET_THICKNESS: sheet_thickness_m,
    }
    for key, value in {**numbers, **parameters}.items():
        if np.ndim(value):
            raise ConfigError(f"{key} is {value!r}; expected one number.")
    for key, value in numbers.items():
        real_array(key.removeprefix("radarsim_"), value, minimum=0.0)
    if not isinstance(name, str):
        raise ConfigError(f"The name of a material is {name!r}; expected text.")
    index = Medium(medium, parameters, path).index(carrier_hz)
    material = bpy.data.materials.new(name)
    material[MEDIUM] = medium
    if path is not None:
        material[PATH] = path
    for key, value in parameters.items():
        material[PARAMETER_PREFIX + key] = float(value)
    for key, value in numbers.items():
        if value > 0:
            material[key] = float(value)
    try:
        make_physical(material, not is_conductor(index) if penetrable is None else penetrable)
        update_material(material, carrier_hz)
    except BaseException:
        bpy.data.materials.remove(material)
        raise
    return material


def make_physical(material: bpy.types.Material, penetrable: bool = True) -> None:
    """Replace the nodes of a material by the physical group; with a thickness, by the sheet's."""
    if float(material.get(SHEET_THICKNESS, 0.0)) > 0:
        link_group(material, ensure_group(SHEET_KIND), False)
    else:
        link_group(material, ensure_group(PHYSICAL_KIND), penetrable)


def inputs_at(
    material: bpy.types.Material, carrier_hz: float, beyond_band: str = "hold"
) -> dict[str, float]:
    """Return the group's inputs at a carrier by socket name. A ConfigError names the material."""
    medium = medium_of(material)
    if medium is None:
        return {}
    try:
        index = medium.index(carrier_hz, beyond_band)
        if is_sheet(material):
            wavelengths = float(material.get(SHEET_THICKNESS, 0.0)) * carrier_hz
            thickness = wavelengths / SPEED_OF_LIGHT_MPS
            return {INDEX: index.real, EXTINCTION: index.imag, THICKNESS: thickness}
        slope = rough_surface_of(material).slope
        roughness = float(cycles_roughness(slope))
        through, through_grazing = 1.0, 1.0
        if not is_conductor(index):
            through, through_grazing = transmission_factors(index, slope, EXACT_FACETS)
    except RadarSimError as error:
        raise ConfigError(f"Material {material.name!r}: {error}") from error
    return {
        INDEX: index.real,
        EXTINCTION: index.imag,
        ROUGHNESS: roughness,
        TRANSMISSION: through,
        GRAZING_TRANSMISSION: through_grazing,
    }


def update_material(
    material: bpy.types.Material, carrier_hz: float, beyond_band: str = "hold"
) -> None:
    """Set the inputs of a physical material for a carrier; linked sockets do not change.

    Raises ConfigError as `inputs_at`, or for a linked file with a group of an older radarsim.
    """
    for socket, value in _inputs_to_set(material, carrier_hz, beyond_band):
        set_input(socket, value, None)


def _inputs_to_set(
    material: bpy.types.Material, carrier_hz: float, beyond_band: str
) -> list[tuple[Any, float]]:
    node = group_node(material)
    if node is None or not is_physical(material):
        return []
    found = []
    for name, value in inputs_at(material, carrier_hz, beyond_band).items():
        if node.inputs.get(name) is None:
            library = material.library
            where = "this file" if library is None else repr(library.filepath)
            raise ConfigError(
                f"Material {material.name!r}: its node group {node.node_tree.name!r} is from "
                f"another radarsim and has no input {name!r}. Open {where} with this radarsim and "
                "save it, or append the material instead of linking it."
            )
        socket = group_input(material, name)
        if socket is not None:
            found.append((socket, value))
    return found


def update_materials(
    carrier_hz: float,
    recorder: SettingsRestorer | None = None,
    assigned: Collection[Any] | None = None,
    beyond_band: str = "hold",
) -> list[Finding]:
    """Evaluate all physical materials of the file at a carrier, permanently without a recorder.

    Materials that are linked from another file are set in memory; that file is not changed.
    `assigned` are the materials of rendered objects, None: those in the slots of all objects of the
    file.

    Returns findings about assigned materials with a medium that keep their numbers, because their
    group is not at the output. Others that cannot be evaluated keep theirs, too, and change no
    result. Raises ConfigError if a material of a rendered object cannot be evaluated, or two of
    them use one node group with different numbers.
    """
    if assigned is None:
        shown = (item for item in bpy.data.objects if not item.hide_render)
        assigned = {one for item in shown for one in slot_materials(item) if one is not None}
    findings = []
    owners: dict[int, tuple[Any, float]] = {}
    # Assigned materials are first: their numbers have priority in a common node group.
    for material in sorted(bpy.data.materials, key=lambda m: (m not in assigned, m.name_full)):
        try:
            for socket, value in _inputs_to_set(material, carrier_hz, beyond_band):
                other, before = owners.setdefault(socket.as_pointer(), (material, value))
                if value != before:
                    raise ConfigError(_shared(other, material))
                set_input(socket, value, recorder)
        except ConfigError:
            if material in assigned:
                raise
        if material in assigned and _keeps_numbers(material):
            findings.append(finding("medium-not-connected", material.name))
    return findings


def _shared(first: Any, second: Any) -> str:
    found = find_group(second)
    nested = found is not None and bool(found.enclosing)
    tree = found.enclosing[-1].node_tree if found and nested else second.node_tree
    return (
        f"Materials {first.name!r} and {second.name!r} need different numbers in the node group "
        f"{tree.name!r}, which both use. Make it a single-user copy in one of them, or connect the "
        "inputs of the Radar Material to inputs of the group."
    )


def _keeps_numbers(material: bpy.types.Material) -> bool:
    """Return whether a material with a medium has our group, but not at its output."""
    return (
        material.node_tree is not None
        and medium_of(material) is not None
        and find_group(material) is None
        and holds_group(material.node_tree)
    )


def refresh_materials(carrier_hz: float, beyond_band: str = "hold") -> None:
    """Evaluate all physical materials; one that cannot be evaluated keeps its numbers."""
    for material in bpy.data.materials:
        with contextlib.suppress(ConfigError):
            update_material(material, carrier_hz, beyond_band)


# Materials that are ready for use: those of the Asset Browser, and more for everyday names.


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


# Where the models of a material do not hold: bands of media, and Kirchhoff's surfaces.


def _beyond_its_band(
    material: bpy.types.Material, carrier_hz: float, beyond_band: str
) -> list[Finding]:
    medium = medium_of(material) if is_physical(material) else None
    if medium is None or beyond_band == "refuse":
        return []
    found = medium.model.out_of_band(carrier_hz, **medium.parameters)
    if found is None:
        return []
    return [
        finding(
            "medium-beyond-band",
            material.name,
            carrier_hz=carrier_hz,
            medium=medium.name,
            band=medium.model.band_text,
            edge_hz=found.edge_hz,
            beyond_band=beyond_band,
            reflection_db=found.reflection_db,
            absorption_ratio=found.absorption_ratio,
            error_class=found.error_class,
        )
    ]


def media_beyond_their_band(
    carrier_hz: float, beyond_band: str = "hold", materials: Iterable[Any] | None = None
) -> list[Finding]:
    """Find the physical materials whose medium is not defined at a carrier.

    `materials` are those of rendered objects, None: those of the file that are used. Unknown media
    are told by the panel and the run.
    """
    found = []
    if materials is None:
        materials = [item for item in bpy.data.materials if item.users > item.use_fake_user]
    for material in materials:
        if MEDIUM in material:
            with contextlib.suppress(ConfigError):
                found += _beyond_its_band(material, carrier_hz, beyond_band)
    return found


def limits_of(material: bpy.types.Material, carrier_hz: float) -> tuple[Finding, ...]:
    """Find why the model of a material's rough surface does not hold at a carrier."""
    surface = rough_surface_of(material)
    if surface.rms_height_m == 0 or surface.correlation_length == 0:
        return ()
    found = kirchhoff_limits(
        surface.rms_height_m, surface.correlation_length, SPEED_OF_LIGHT_MPS / carrier_hz
    )
    return tuple(item.about(material.name) for item in found)


def roughness_of(materials: Iterable[Any]) -> tuple[float | None, float | None]:
    """Return RMS height and correlation length [m] of the first of an object's materials that has a
    height; None if unknown.
    """
    for material in materials:
        if material is None:
            continue
        height_m = float(material.get(RMS_HEIGHT, 0.0))
        if height_m > 0:
            return height_m, float(material.get(CORRELATION_LENGTH, 0.0)) or None
    return None, None
