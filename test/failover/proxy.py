"""A TCP proxy that cuts or stalls its connections when told to."""

import asyncio
import socket
import struct
import threading

ADDRESS = "127.0.0.1"
_CHUNK = 65536


class Proxy:
    """Forwards its `port` to another one, on a thread, until close()."""

    def __init__(self, target: int) -> None:
        self.port = 0
        self.forwarded = 0  # bytes of clients
        self._target = target
        self._writers: set[asyncio.StreamWriter] = set()
        self._refuses = False
        self._loop = asyncio.new_event_loop()
        self._requests = asyncio.Event()  # set: they flow
        self._answers = asyncio.Event()
        self._flow()
        self._server = None
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.daemon = True
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result()

    def drop(self) -> None:
        """Resets all connections, and new ones until heal()."""
        self._tell(self._drop)

    def stall(self) -> None:
        """Lets no byte through in either direction until heal()."""
        self._tell(self._stall)

    def hold_answers(self) -> None:
        """Lets no byte through to clients until heal()."""
        self._tell(self._answers.clear)

    def heal(self) -> None:
        self._tell(self._heal)

    def close(self) -> None:
        self._tell(self._drop)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._server.close()

    def _tell(self, action) -> None:
        async def act() -> None:
            action()

        asyncio.run_coroutine_threadsafe(act(), self._loop).result()

    def _flow(self) -> None:
        self._requests.set()
        self._answers.set()

    def _stall(self) -> None:
        self._requests.clear()
        self._answers.clear()

    def _heal(self) -> None:
        self._refuses = False
        self._flow()

    def _drop(self) -> None:
        self._refuses = True
        for writer in list(self._writers):
            _reset(writer)
        self._flow()

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._accept, ADDRESS, 0)
        self.port = self._server.sockets[0].getsockname()[1]

    async def _accept(self, reader, writer) -> None:
        if self._refuses:
            _reset(writer)
            return
        try:
            opened = await asyncio.open_connection(ADDRESS, self._target)
        except OSError:
            _reset(writer)
            return
        there_reader, there_writer = opened
        both = (writer, there_writer)
        self._writers.update(both)
        await asyncio.gather(
            self._pump(reader, there_writer, self._requests),
            self._pump(there_reader, writer, self._answers),
        )
        self._writers.difference_update(both)
        for end in both:
            end.close()

    async def _pump(self, reader, writer, flows: asyncio.Event) -> None:
        try:
            while chunk := await reader.read(_CHUNK):
                await flows.wait()
                if flows is self._requests:
                    self.forwarded += len(chunk)
                writer.write(chunk)
                await writer.drain()
            await flows.wait()
            writer.write_eof()
        except OSError:
            _reset(writer)


def _reset(writer) -> None:
    """Ends a connection by RST."""
    try:
        sock = writer.get_extra_info("socket")
        linger = struct.pack("ii", 1, 0)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    except OSError:
        pass
    writer.transport.abort()
