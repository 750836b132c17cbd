# SPDX-License-Identifier: GPL-3.0-or-later
"""What is run under each version: scenes, and how their runs are processed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

DATA = Path(__file__).resolve().parents[2] / "tests" / "data" / "compare"


@dataclass(frozen=True)
class Processing:
    """One ``process`` over a run, into a folder of this name.

    Options are ``--name`` or ``--name=value``; ``{data}`` is the folder of the input files. What a
    version calls otherwise is looked up in ``renames.json``.
    """

    name: str
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Case:
    """A scene whose settings are in the .blend file, rendered once and processed.

    Attributes
    ----------
    name
        Of the case and of its .blend file. "demo" has none: ``scripts/demo.py`` builds its own.
    what
        For the list of cases.
    processings
        One or more.
    slow
        Takes more than about ten seconds: left out unless it is asked for.
    """

    name: str
    what: str
    processings: tuple[Processing, ...] = ()
    slow: bool = False

    @property
    def scene(self) -> Path | None:
        """The .blend file."""
        return None if self.name == "demo" else DATA / f"{self.name}.blend"


#: Every case but the demo writes no pictures.
CASES: tuple[Case, ...] = (
    Case(
        "rings_paper",
        "the paper's scene in 13 coarse rings, two snapshots, LFM",
        (
            Processing("products", ("--hdf5", "--sigmf")),
            Processing(
                "products_paper",
                ("--amplitude-model=paper", "--mti=2", "--range-taper=hann", "--speckle-seed=none"),
            ),
        ),
    ),
    Case(
        "paths_walls",
        "two reflections, two penetrable walls, error target, range encoding of materials",
        (
            Processing("products", ("--hdf5",)),
            Processing("products_stepped", ("--waveform={data}/waveform_stepped.json", "--hdf5")),
        ),
    ),
    Case(
        "paths_fmcw_moving",
        "77 GHz FMCW, all moves, Gaussian and array antenna, thermal noise, CFAR",
        (
            Processing(
                "products",
                (
                    "--thermal-noise",
                    "--noise-seed=7",
                    "--cfar=os",
                    "--cfar-train=3,6",
                    "--hdf5",
                    "--sigmf",
                ),
            ),
            Processing(
                "products_other_system",
                (
                    "--link-budget={data}/link_budget.json",
                    "--adc-bits=10",
                    "--phase-noise={data}/phase_noise.csv",
                    "--range-taper=blackman",
                    "--doppler-taper=hann",
                    "--mti=3",
                    "--cfar=ca",
                    "--pfa=1e-5",
                    "--hdf5",
                ),
            ),
        ),
    ),
    Case(
        "paths_pmcw_moving",
        "24 GHz PMCW, one replicate, a van recedes",
        (
            Processing("products", ("--hdf5", "--cfar=ca")),
            Processing(
                "products_direct", ("--slow-time-transform=direct", "--nufft-backend=direct")
            ),
        ),
    ),
    Case(
        "paths_deforming",
        "shape key and modifier over time, two frames",
        (Processing("products", ("--hdf5",)),),
    ),
    Case(
        "paths_orthographic",
        "orthographic receiver, a thin pane, horizontal polarisation",
        (Processing("products", ("--hdf5", "--noise-figure-db=5", "--range-limits=2:40")),),
    ),
    Case(
        "paths_equirectangular",
        "most of the sphere, foreign materials, range encoding of the world, stepped frequency",
        (Processing("products", ("--hdf5", "--sigmf")),),
    ),
    Case(
        "paths_bursts",
        "three renders a burst, a door and instances move, Barker pulse",
        (Processing("products", ("--hdf5", "--receive-antenna-gain-dbi=3")),),
    ),
    Case("demo", "the paper's experiment as `make demo` runs it", slow=True),
)


def chosen_cases(names: list[str] | None, slow: bool) -> list[Case]:
    """Cases by name; none given: all but the slow ones, or all.

    Raises
    ------
    ValueError
        There is no such case.
    """
    if not names:
        return [case for case in CASES if slow or not case.slow]
    known = {case.name: case for case in CASES}
    strange = [name for name in names if name not in known]
    if strange:
        raise ValueError(f"There is no case {', '.join(strange)}; there are: {', '.join(known)}.")
    return [known[name] for name in names]
