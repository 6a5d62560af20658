"""What is added to viser's page in the browser: words without WebGL, scale bar and legend, a cursor in plots, names.

`front.js` and `front.css` go into the head of the page that viser serves. What they show over the picture the server
says in elements of the panel with an attribute `data-otwarp`, which `overlay` makes; the script copies them there.
"""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

DRAGS = (
    ("drag", "turn the view"),
    ("right button, or two fingers", "move the view"),
    ("wheel, or pinch", "zoom"),
)
"""What the mouse does in the picture."""


@cache
def _file(name: str) -> str:
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def head(title: str, keys: Sequence[tuple[str, str]] = (), drags: Sequence[tuple[str, str]] = DRAGS) -> str:
    """HTML for the end of the head of the page.

    Args:
        title: Of the page.
        keys: Keys and what they do, for the help.
        drags: The same of the mouse.
    """
    arrows = any("←" in key for key, _ in keys)
    said = json.dumps({"title": title, "keys": list(keys), "drags": list(drags), "arrows": arrows}).replace(
        "<", "\\u003c"
    )
    return (
        f"<style>{_file('front.css')}</style>"
        f'<script type="application/json" id="otwarp-front">{said}</script>'
        f"<script>{_file('front.js')}</script>"
    )


def with_head(page: str, head: str) -> str:
    """The page with its title and this at the end of its head."""
    return page.replace("</head>", f"{head}</head>", 1)


def overlay(name: str, content: str = "", **data: float) -> str:
    """An element of a panel that the script shows over the picture.

    Args:
        name: `scale`, `legend`, `note` or `cursor`.
        content: HTML of it.
        data: Numbers: `pixels` of a scale bar, `share` of the plots' width at which the cursor stands, `first` and
            `last` time of the plots [s].
    """
    said = "".join(f' data-{key}="{value:.6g}"' for key, value in data.items())
    return f'<div data-otwarp="{html.escape(name)}"{said} hidden>{content}</div>'
