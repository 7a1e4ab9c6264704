"""Scenes in a browser while they change: meshcat's server in this process, for this machine alone."""

from __future__ import annotations

import asyncio
import socket
import threading
import time
from uuid import uuid4

from fes_pin.data.errors import InputError
from fes_pin.view.viewer import BodyScene, import_meshcat

LOOPBACK = "127.0.0.1"
FIRST_PORT, PORTS = 7000, 100
"""The port that meshcat's own server begins with, and how many are tried."""


class LiveViewer:
    """meshcat's server in a thread of this process, until `close` or the end of a `with` block.

    It listens on the loopback address alone, for pages are open to whoever reaches the port; what draws reaches it
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
        import_meshcat()
        import zmq  # noqa: PLC0415

        listener = _listening_socket()
        self.url = f"http://{LOOPBACK}:{listener.getsockname()[1]}/static/"
        self._inside = f"inproc://fes-pin-{uuid4()}"
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(listener,), daemon=True)
        self._thread.start()
        self._started.wait()
        from meshcat.servers.zmqserver import ZMQWebSocketBridge  # noqa: PLC0415

        self._drawing = ZMQWebSocketBridge.context.socket(zmq.REQ)
        self._drawing.connect(self._inside)

    def _serve(self, listener: socket.socket) -> None:
        """The thread: an event loop of its own with the server in it."""
        self._loop = asyncio.new_event_loop()
        asyncio.set_event_loop(self._loop)
        server = _bridge()(self._inside, listener)
        self._loop.call_soon(self._started.set)
        self._loop.run_forever()
        server.zmq_stream.close(linger=0)
        server.http.stop()
        for page in list(server.websocket_pool):
            page.close()
        self._loop.run_until_complete(server.http.close_all_connections())
        self._loop.close()

    def show(self, scene: BodyScene) -> None:
        """Show a scene instead of what was there before."""
        from meshcat.commands import Delete  # noqa: PLC0415
        from meshcat.path import Path  # noqa: PLC0415

        self._send(Delete(Path(("meshcat",))))
        for command in scene.commands():
            self._send(command)

    def _send(self, command) -> None:
        import umsgpack  # noqa: PLC0415

        words = command.lower()
        self._drawing.send_multipart([words["type"].encode(), words["path"].encode(), umsgpack.packb(words)])
        self._drawing.recv()

    def wait(self) -> None:
        """Until the server ends or the caller is interrupted."""
        while self._thread.is_alive():
            time.sleep(0.2)

    def close(self) -> None:
        """End the server."""
        self._drawing.close(linger=0)
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()

    def __enter__(self) -> LiveViewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _listening_socket() -> socket.socket:
    """A socket that listens on the first free port of the loopback address."""
    for port in range(FIRST_PORT, FIRST_PORT + PORTS):
        try:
            found = socket.create_server((LOOPBACK, port))
        except OSError:
            continue
        found.setblocking(False)
        return found
    raise InputError(f"no port is free between {FIRST_PORT} and {FIRST_PORT + PORTS - 1}")


def _bridge() -> type:
    """meshcat's server between the drawing socket and the pages, on a socket that is given to it, and silent."""
    from meshcat.servers import zmqserver  # noqa: PLC0415
    from tornado.httpserver import HTTPServer  # noqa: PLC0415
    from tornado.web import Application  # noqa: PLC0415

    class Page(zmqserver.WebSocketHandler):
        def open(self) -> None:
            self.bridge.websocket_pool.add(self)
            self.bridge.send_scene(self)

        def on_close(self) -> None:
            self.bridge.websocket_pool.discard(self)

    class Bridge(zmqserver.ZMQWebSocketBridge):
        def __init__(self, inside: str, listener: socket.socket) -> None:
            self.listener = listener
            super().__init__(zmq_url=inside, host=LOOPBACK, port=listener.getsockname()[1])

        def make_app(self) -> Application:
            bridge = self

            class Loopback(Application):
                def listen(self, port: int, address: str | None = None, **options) -> HTTPServer:
                    bridge.http = HTTPServer(self, **options)
                    bridge.http.add_socket(bridge.listener)
                    return bridge.http

            files = {"path": zmqserver.VIEWER_ROOT, "default_filename": zmqserver.VIEWER_HTML}
            return Loopback(
                [(r"/static/(.*)", zmqserver.StaticFileHandlerNoCache, files), (r"/", Page, {"bridge": self})],
                log_function=lambda _handler: None,
            )

    return Bridge
