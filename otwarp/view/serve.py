"""Serves a page of recordings from this process until it is told to end."""

from __future__ import annotations

import importlib.util
import io
import logging
import os
import socket
import threading
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from typing import TYPE_CHECKING

from otwarp.errors import InputError
from otwarp.teleop.page.access import access_for, address, check_host, choose_token, listen
from otwarp.teleop.page.front import DRAGS, head
from otwarp.teleop.page.viser_internals import guarded_server, without_override

if TYPE_CHECKING:
    import viser


@dataclass(frozen=True, kw_only=True)
class ServeOptions:
    """Where a page is served.

    Attributes:
        host: Interface to listen on; others than loopback need a token.
        port: None for 8080 or the next free one, 0 for any.
        token: Secret that opens the page; None makes one up where others than this machine's users could reach it.
        browser: Whether a browser is opened.

    Raises:
        InputError: A host that has no address.
    """

    host: str = "127.0.0.1"
    port: int | None = None
    token: str | None = None
    browser: bool = False

    def __post_init__(self) -> None:
        check_host(self.host)


@contextmanager
def served(
    options: ServeOptions,
    title: str,
    keys: Sequence[tuple[str, str]],
    say: Callable[[str], None],
    drags: Sequence[tuple[str, str]] = DRAGS,
) -> Iterator[viser.ViserServer]:
    """A guarded server of viser, whose address is said and opened; it ends with the block, which Ctrl-C ends in order.

    Args:
        options: Where.
        title: Of the page.
        keys, drags: For its help.
        say: Gets the line with the address.

    Raises:
        InputError: viser is not installed, or the host, port or token cannot be.
    """
    if importlib.util.find_spec("viser") is None:
        raise InputError("page: needs viser; install otwarp[teleop]")
    choose_token(options.token, loopback=True)
    without_override(os.environ)
    # a browser that opens a connection and thinks better of it is no news for the terminal
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    listening = listen(options.host, options.port)
    access = access_for(listening, options.token)
    with redirect_stdout(io.StringIO()):  # viser prints its own address, which is not the one to open
        server = guarded_server(listening, access, title, head(title, keys, drags))
    try:
        name = socket.gethostname() if options.host in ("0.0.0.0", "::") else options.host
        url = address(name, access.port, access.token)
        say(f"page {url}  (Ctrl-C ends)")
        if options.browser:
            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
        yield server
    except KeyboardInterrupt:
        say("")  # after the ^C of the terminal
    finally:
        with redirect_stdout(io.StringIO()):  # viser says that it has
            server.stop()
