"""Scale bars: one in each window, as its camera sees the scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from otwarp.teleop.page.front import overlay
from otwarp.view.sight import Look, length_text, pixels_per_micrometre, round_length

if TYPE_CHECKING:
    import viser


class ScaleBars:
    """Scale bars of all windows of a page.

    Args:
        server: Of viser.
        post: Runs a function in the page's thread.
    """

    def __init__(self, server: viser.ViserServer, post: Callable[[Callable[[], None]], None]):
        self._server, self._post = server, post
        self._handles: dict[int, Any] = {}
        self._shown = True
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)

    def show(self, on: bool) -> None:
        """Show them, or not."""
        self._shown = on
        for client in self._server.get_clients().values():
            self._update(client)

    async def _connected(self, client: Any) -> None:
        self._post(lambda: self._visit(client))

    async def _disconnected(self, client: Any) -> None:
        self._post(lambda: self._handles.pop(client.client_id, None))

    def _visit(self, client: Any) -> None:
        self._handles[client.client_id] = client.gui.add_html(overlay("scale"))
        self._update(client)

        async def moved(_: Any) -> None:
            self._post(lambda: self._update(client))

        client.camera.on_update(moved)

    def _update(self, client: Any) -> None:
        handle, camera = self._handles.get(client.client_id), client.camera
        if handle is None or not camera.image_height or not camera.fov:
            return
        look = Look(tuple(camera.position), tuple(camera.look_at))  # type: ignore[arg-type]
        per = pixels_per_micrometre(look, float(camera.fov), camera.image_height)
        length = round_length(per)
        content = overlay("scale", length_text(length), pixels=length * per) if self._shown else overlay("scale")
        if handle.content != content:
            handle.content = content
