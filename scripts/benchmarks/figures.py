# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of what bench.py measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..picture_text import use_readable_text

_STYLES = {
    "rings": {"marker": "s", "color": "tab:red", "linestyle": "none"},
    "paths": {"marker": "o", "color": "tab:blue"},
    "replicates": {"marker": "d", "color": "tab:purple"},
    "tiles": {"marker": "*", "color": "tab:orange"},
    "refined": {"marker": "^", "color": "tab:green"},
}
_LABELS = {
    "rings": "21 rings",
    "paths": "paths, more pixels",
    "replicates": "paths, more replicates",
    "tiles": "paths, tiles laid over small objects",
    "refined": "paths, tiles refined",
}


def draw(result: dict[str, Any], folder: Path) -> list[Path]:
    """All pictures; returns their files."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    use_readable_text(pyplot)
    files = []
    parts = {"accuracy": _accuracy, "scaling": _scaling, "synthesis": _synthesis}

    def save(figure: Any, name: str) -> None:
        path = folder / name
        figure.savefig(path, dpi=110, bbox_inches="tight")
        pyplot.close(figure)
        files.append(path)

    for name, part in parts.items():
        if name in result:
            part(pyplot, result[name], save)
    return files


def _accuracy(pyplot: Any, accuracy: Any, save: Callable[[Any, str], None]) -> None:
    """Error against time."""
    figure, axes = pyplot.subplots(1, 3, figsize=(15, 5.0), layout="constrained")
    panels = (
        ("error", "Range profile, 2.5 m bins", "relative L2 error", "standard_error"),
        ("error_coarse", "Range profile, 25 m bins", "relative L2 error", "standard_error_coarse"),
        ("target_db", "Power of the target", "|error| [dB]", None),
    )
    for axis, (key, title, label, floor) in zip(axes, panels):
        for kind, style in _STYLES.items():
            rows = sorted(
                (r for r in accuracy["runs"] if r["series"] == kind), key=lambda r: r["cpu_s"]
            )
            axis.loglog(
                [r["cpu_s"] for r in rows],
                [max(abs(r[key]), 1e-5) for r in rows],
                label=_LABELS[kind] if axis is axes[0] else None,
                **style,
            )
        if floor:
            axis.axhline(
                accuracy["reference"][floor],
                color="grey",
                linestyle=":",
                label="standard error of the reference" if axis is axes[0] else None,
            )
        else:
            axis.axhline(0.2, color="grey", linestyle="--", label="0.2 dB")
        axis.set_title(title)
        axis.set_xlabel("processor time, scene to profile [s]")
        axis.set_ylabel(label)
        axis.grid(True, which="both", alpha=0.25)
    # one for all three: within the axes it would cover points
    figure.legend(loc="outside lower center", ncols=4)
    save(figure, "error_against_time.png")


def _scaling(pyplot: Any, scaling: Any, save: Callable[[Any, str], None]) -> None:
    """Cost and memory against the number of paths."""
    rows = sorted(scaling, key=lambda r: r["paths"])
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.5, 4.4), layout="constrained")
    left.loglog([r["paths"] for r in rows], [r["cpu_s"] for r in rows], "o", label="measured")
    last = rows[-1]
    left.loglog(
        [r["paths"] for r in rows],
        [last["cpu_s"] * r["paths"] / last["paths"] for r in rows],
        "--",
        color="grey",
        label="linear",
    )
    left.set_xlabel("paths in the run")
    left.set_ylabel("processor time [s]")
    left.legend()
    right.semilogx([r["paths"] for r in rows], [r["peak_mib"] for r in rows], "o")
    right.set_ylim(bottom=0)
    right.set_xlabel("paths in the run")
    right.set_ylabel("peak memory without mapped files [MiB]")
    for axis in (left, right):
        axis.grid(True, which="both", alpha=0.25)
    figure.suptitle("Cost and memory of the acquisition 'paths', tiles of 256 pixels")
    save(figure, "cost_against_paths.png")


def _synthesis(pyplot: Any, synthesis: Any, save: Callable[[Any, str], None]) -> None:
    """Echo synthesis."""
    figure, axis = pyplot.subplots(figsize=(6, 4.4))
    rows = synthesis["rows"]
    for engine, label in (
        ("direct", "direct sum (scaled above 3125 paths)"),
        ("finufft", "finufft"),
    ):
        key = f"{engine}_cpu_s"
        chosen = [r for r in rows if key in r]
        if chosen:
            axis.loglog([r["paths"] for r in chosen], [r[key] for r in chosen], "o-", label=label)
        if f"{engine}_error" in rows[-1]:
            for row in chosen:
                axis.annotate(
                    f"{row[f'{engine}_error']:.0e}",
                    (row["paths"], row[key]),
                    textcoords="offset points",
                    xytext=(0, 6),
                    ha="center",
                )
    axis.set_xlabel("paths")
    axis.set_ylabel("processor time [s]")
    axis.set_title(
        f"One spectrum of {synthesis['frequencies']} frequencies, tolerance "
        f"{synthesis['tolerance']:g} (labels: error)"
    )
    axis.grid(True, which="both", alpha=0.25)
    axis.legend()
    save(figure, "synthesis.png")
