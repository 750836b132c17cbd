# SPDX-License-Identifier: GPL-3.0-or-later
"""Interiors of objects for a run: where waves enter and come out again, and where they do not."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ...errors import ConfigError
from ...findings import Finding, finding
from ..nodes.group_search import group_input, group_node
from ..nodes.materials import TRANSMISSIONS, lets_nothing_through, volume_link
from ..state import SettingsRestorer


def settle_interiors(recorder: SettingsRestorer, materials: Iterable[Any]) -> list[Finding]:
    """Make Radar Materials opaque, until they are restored, if their Volume is not connected.

    Without the Volume of the Material Output, Cycles does not attenuate waves inside the object.
    The Volume of materials that are opaque anyway is disconnected, because it costs render time.

    Parameters
    ----------
    recorder
        Records the changes, so that they can be restored.
    materials
        Materials of the rendered objects, evaluated at the carrier.

    Returns
    -------
    list of Finding
        Names the materials that the missing Volume makes opaque.

    Raises
    ------
    ConfigError
        Two materials, one with Volume, share the node that would be changed.
    """
    closed: list[Any] = []
    opaque: list[Any] = []
    entered: dict[int, Any] = {}
    for material in sorted(materials, key=lambda item: item.name_full):
        link = volume_link(material)
        if lets_nothing_through(material):
            opaque.append(material)
            if link is not None:
                _unlink(recorder, material, link)
        elif link is not None:
            entered |= {socket.as_pointer(): material for socket in _transmissions(material)}
        elif _transmissions(material):
            closed.append(material)
    # Also what the surface of a metal lets in (0.3 % at grazing incidence) ends in its skin.
    for material in (*closed, *opaque):
        for socket in _transmissions(material):
            other = entered.get(socket.as_pointer())
            if other is not None:
                raise ConfigError(
                    f"Materials {material.name!r} and {other.name!r} use one node group, but only "
                    f"{other.name!r} has its Volume connected. Connect Volume in both, or make the "
                    "group a single-user copy in one of them."
                )
            recorder.set(socket, "default_value", 0.0)
    names = [material.name for material in closed]
    return [finding("opaque-without-volume", *names)] if names else []


def _transmissions(material: Any) -> list[Any]:
    """Sockets that scale the transmitted power; none where a node is linked to them."""
    node = group_node(material)
    names = [] if node is None else [name for name in TRANSMISSIONS if name in node.inputs]
    sockets = [group_input(material, name) for name in names]
    return [socket for socket in sockets if socket is not None]


def _unlink(recorder: SettingsRestorer, material: Any, link: Any) -> None:
    links, source, target = material.node_tree.links, link.from_socket, link.to_socket
    links.remove(link)
    recorder.on_restore(f"Volume of {material.name}", lambda: links.new(source, target))
