"""Scenes in a browser while they change: a server in this process, for this machine alone."""

from __future__ import annotations

import os
import time
from contextlib import AbstractContextManager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from fes_pin.data.errors import InputError
from fes_pin.view.viewer import BodyScene

LOOPBACK = "127.0.0.1"
FIRST_PORT, PORTS = 7000, 100
"""The first port, and how many are tried."""
_FOLLOW = """<script>
setInterval(async () => {{
  const now = await fetch("/count").then(answer => answer.text(), () => "{count}");
  if (now !== "{count}") location.reload();
}}, 300);
</script>
"""
"""A page asks which scene is shown, and is loaded again when that has changed."""


class LiveViewer(AbstractContextManager["LiveViewer"]):
    """A server in a thread of this process, until `close` or the end of a `with` block.

    It listens on the loopback address alone, for pages are open to whoever reaches the port; what is shown reaches it
    inside the process, without a port. However the process ends, the server ends with it.

    Attributes
    ----------
    url
        To open in a browser; pages that are open show the next scene at once.

    Raises
    ------
    InputError
        No port is free.

    Examples
    --------
    >>> with LiveViewer() as viewer:
    ...     viewer.show(show_mode(linear, linear.modes()[0]))
    ...     input(viewer.url)
    """

    def __init__(self) -> None:
        self._server = _server()
        self.url = f"http://{LOOPBACK}:{self._server.server_port}/"
        self._thread = Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)
        self._thread.start()

    def show(self, scene: BodyScene) -> None:
        """Show a scene instead of what was there before."""
        count = self._server.shown[0] + 1
        self._server.shown = (count, scene.html() + _FOLLOW.format(count=count))

    def wait(self) -> None:
        """Until the server ends or the caller is interrupted."""
        while self._thread.is_alive():
            time.sleep(0.2)

    def close(self) -> None:
        """End the server."""
        self._server.shutdown()
        self._server.server_close()

    def __exit__(self, *_: object) -> None:
        self.close()


class _Answer(BaseHTTPRequestHandler):
    """The page, or the number of the scene that it shows."""

    server: _Server

    def do_GET(self) -> None:
        count, page = self.server.shown
        content = str(count) if self.path == "/count" else page
        self.send_response(200)
        self.send_header("Content-Type", "text/html; charset=utf-8")
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content.encode())

    def log_message(self, format: str, *args: object) -> None:
        """Nothing is printed."""


class _Server(ThreadingHTTPServer):
    allow_reuse_address = os.name == "posix"  # elsewhere it gives one port to two servers
    shown = (0, _FOLLOW.format(count=0))


def _server() -> _Server:
    """A server on the first free port of the loopback address."""
    for port in range(FIRST_PORT, FIRST_PORT + PORTS):
        with suppress(OSError):
            return _Server((LOOPBACK, port), _Answer)
    raise InputError(f"no port is free between {FIRST_PORT} and {FIRST_PORT + PORTS - 1}")
