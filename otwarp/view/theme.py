"""Colours of the page: dark for work, light for slides."""

from __future__ import annotations

from dataclasses import dataclass

from otwarp.teleop.page.protocol import Colour
from otwarp.teleop.page.scene_view import BACKGROUND, LIGHT_BACKGROUND


@dataclass(frozen=True)
class Theme:
    """Colours that viser does not choose.

    Attributes:
        light: Whether the page is light.
        background: Behind the scene, in its middle.
        curves: Of plots, one after the other.
        warning: Of warning lines.
        axis, grid: Of axes and their grid.
        quiet: Of names beside values.
        mark: Of measured places.
    """

    light: bool
    background: Colour
    curves: tuple[str, ...]
    warning: str
    axis: str
    grid: str
    quiet: str
    mark: Colour


DARK = Theme(
    light=False,
    background=BACKGROUND[0],
    curves=("#ff7a5c", "#45d0ff", "#ffe27a", "#6ee7a8", "#b18cff", "#f28cc8"),
    warning="#ff405c",
    axis="#b4c2d3",
    grid="rgba(160,180,205,0.13)",
    quiet="#9fb0c4",
    mark=(255, 255, 255),
)
LIGHT = Theme(
    light=True,
    background=LIGHT_BACKGROUND[0],
    curves=("#c2340f", "#0b6fa4", "#8a6a00", "#11793f", "#6a3fc8", "#a81f6f"),
    warning="#c00022",
    axis="#33414f",
    grid="rgba(40,60,80,0.14)",
    quiet="#4a5a6a",
    mark=(10, 14, 20),
)
THEMES = {"dark": DARK, "light": LIGHT}
