#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the example scenes of blend_examples/: street, sea, drone, indoor.

    python scripts/make_examples.py [NAME ...]              # the .blend files
    python scripts/make_examples.py --pictures [NAME ...]   # also docs/images/example_NAME.png

With pictures each scene is measured and processed as its README says, and the processor seconds of
both are printed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import warnings
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import bpy  # noqa: E402

from radarsim_addon import blender as radarsim  # noqa: E402
from radarsim_addon.signal import ProcessOptions  # noqa: E402
from scripts.examples import EXAMPLES  # noqa: E402
from scripts.examples.shared import FOLDER, write  # noqa: E402


def picture(name: str, folder: Path) -> None:
    """Measure and process the open scene; draw it."""
    from scripts.examples.pictures import make_picture

    before = time.process_time()
    radar = next(item for item in bpy.context.scene.objects if item.name == "Radar")
    run = radarsim.measure(radar, folder / name, frames=[1])
    measured = time.process_time()
    (result,) = radarsim.process(run, ProcessOptions(thermal_noise=name != "indoor"))
    print(f"{name}: measured in {measured - before:.1f}, processed in "
          f"{time.process_time() - measured:.1f} processor seconds")  # fmt: skip
    for item in result.findings:
        print(f"  {item.severity} {item.code}: {item.message}")
    for echo in result.budget.objects:
        rate = f"{echo.range_rate_mps:.3f} m/s, {echo.rcs_dbsm:.1f} dBsm"
        print(f"  {echo.name}: {echo.range_m:.3f} m, {rate}")
    make_picture(name, result, ROOT / "docs" / "images" / f"example_{name}.png")


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(EXAMPLES))
    parser.add_argument("--pictures", action="store_true", help="measure each and draw it")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="folder of the .blend files")
    chosen = parser.parse_args(argv)
    if unknown := set(chosen.names) - set(EXAMPLES):
        parser.error(f"no example {', '.join(sorted(unknown))}; expected {', '.join(EXAMPLES)}")
    warnings.simplefilter("ignore", UserWarning)  # findings are printed
    with tempfile.TemporaryDirectory(prefix="radarsim_examples_") as folder:
        for name in chosen.names or EXAMPLES:
            write(EXAMPLES[name].build, chosen.folder / f"{name}.blend")
            if chosen.pictures:
                picture(name, Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
