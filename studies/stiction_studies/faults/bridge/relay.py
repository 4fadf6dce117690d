"""A relay between client and server that can be cut."""

import contextlib
import select
import socket
import threading


class Relay:
    """Hands bytes between clients of its own port and a server, unless it is cut."""

    def __init__(self, target: int) -> None:
        """Listen on a free port of 127.0.0.1 for what is to go to port ``target`` there."""
        self._target = target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self._cut = threading.Event()
        self._over = threading.Event()
        self._pairs: list[tuple[socket.socket, socket.socket]] = []
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def cut(self) -> None:
        """End every connection, and let nobody in."""
        self._cut.set()

    def mend(self) -> None:
        """Let everybody in again."""
        self._cut.clear()

    def close(self) -> None:
        """Cut, for good."""
        self._over.set()
        self._thread.join()

    def _serve(self) -> None:
        while not self._over.is_set():
            if self._cut.is_set():
                self._drop()
            ends = [end for pair in self._pairs for end in pair]
            ready, _, _ = select.select([self._listener, *ends], [], [], 0.02)
            for one in ready:
                if one is self._listener:
                    self._accept()
                else:
                    self._pass_on(one)
        self._drop()
        self._listener.close()

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        if self._cut.is_set():
            client.close()
            return
        try:
            self._pairs.append((client, socket.create_connection(("127.0.0.1", self._target))))
        except OSError:
            client.close()

    def _pass_on(self, one: socket.socket) -> None:
        pair = next((pair for pair in self._pairs if one in pair), None)
        if pair is None:
            return
        try:
            data = one.recv(65_536)
            if data:
                pair[pair[0] is one].sendall(data)
                return
        except OSError:
            pass
        self._pairs.remove(pair)
        for end in pair:
            end.close()

    def _drop(self) -> None:
        for pair in self._pairs:
            for end in pair:
                with contextlib.suppress(OSError):
                    end.close()
        self._pairs.clear()
