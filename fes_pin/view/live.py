"""Scenes in a browser while they change: meshcat's server on this machine, one viewer, any number of scenes."""

from __future__ import annotations

import contextlib
import io
import time

from fes_pin.view.viewer import Scene, import_meshcat


class LiveViewer:
    """meshcat's server in a process of its own, until `close` or the end of a `with` block.

    Attributes
    ----------
    url
        To open in a browser; pages that are open show the next scene at once.

    Examples
    --------
    >>> with LiveViewer() as viewer:
    ...     viewer.show(show_mode(linear, linear.modes()[0]))
    ...     input(viewer.url)
    """

    def __init__(self) -> None:
        meshcat = import_meshcat()
        with contextlib.redirect_stdout(io.StringIO()):  # it prints its address
            self._window = meshcat.Visualizer().window
        self.url: str = self._window.web_url

    def show(self, scene: Scene) -> None:
        """Show a scene instead of what was there before."""
        from meshcat.commands import Delete  # noqa: PLC0415
        from meshcat.path import Path  # noqa: PLC0415

        self._window.send(Delete(Path(("meshcat",))))
        for command in scene.commands():
            self._window.send(command)

    def wait(self) -> None:
        """Until the server ends or the caller is interrupted."""
        while self._window.server_proc.poll() is None:
            time.sleep(0.2)

    def close(self) -> None:
        """End the server."""
        self._window.zmq_socket.close(linger=0)
        server = self._window.server_proc
        server.kill()
        server.wait()
        for pipe in (server.stdout, server.stderr):
            pipe.close()

    def __enter__(self) -> LiveViewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
