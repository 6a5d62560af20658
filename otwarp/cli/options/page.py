"""Options of commands that serve a page of recordings or of a scene that is drawn."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from otwarp.cli.options import with_options
from otwarp.cli.types import Number

_OPTIONS = (
    click.option(
        "--theme", type=click.Choice(["dark", "light"]), default="dark", show_default=True, help="Light for slides."
    ),
    click.option("--host", default="127.0.0.1", show_default=True, help="Interface of the page; others need a token."),
    click.option(
        "--port", type=Number(0, 65_535, whole=True), help="Port of the page; default: 8080, or the next that is free."
    ),
    click.option("--token", help="What a browser must know; made by itself where it is needed."),
    click.option("--open/--no-open", "browser", default=True, show_default=True, help="Open a browser."),
)


def page_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the options of where and how its page is served."""
    return with_options(*_OPTIONS)(command)
