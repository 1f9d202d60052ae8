"""Proxies that cut or stall their connections when told to."""

import asyncio
import socket
import struct
import threading

ADDRESS = "127.0.0.1"
_CHUNK = 65536
# The header of a frame of HTTP/2 has so many bytes, with its length and type.
# The types that carry what a server answers are DATA, HEADERS, CONTINUATION.
_FRAME_HEADER = 9
_ANSWERS = (0, 1, 9)


class Proxy:
    """Forwards its `port` of TCP to another one, on a thread, until close()."""

    def __init__(self, target: int) -> None:
        self.port = 0
        self.forwarded = 0  # bytes of clients
        self._target = target
        self._writers: set[asyncio.StreamWriter] = set()
        self._refuses = False
        self._loop = asyncio.new_event_loop()
        self._flows = asyncio.Event()
        self._flows.set()
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
        self._tell(self._flows.clear)

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

    def _heal(self) -> None:
        self._refuses = False
        self._flows.set()

    def _drop(self) -> None:
        self._refuses = True
        for writer in list(self._writers):
            _reset(writer)
        self._flows.set()

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
            self._pump(self._requests(reader), there_writer),
            self._pump(self._answers(there_reader), writer),
        )
        self._writers.difference_update(both)
        for end in both:
            end.close()

    async def _requests(self, reader):
        while chunk := await reader.read(_CHUNK):
            await self._flows.wait()
            self.forwarded += len(chunk)
            yield chunk

    async def _answers(self, reader):
        while chunk := await reader.read(_CHUNK):
            await self._flows.wait()
            yield chunk

    async def _pump(self, chunks, writer) -> None:
        try:
            async for chunk in chunks:
                writer.write(chunk)
                await writer.drain()
            await self._flows.wait()
            writer.write_eof()
        except OSError:
            _reset(writer)


class Http2Proxy(Proxy):
    """One that can lose answers as well, if nothing is encrypted."""

    _loses_answers = False

    def lose_answers(self) -> None:
        """Loses the answers to calls until drop(). What is left of HTTP/2 gets
        through, so that a large request arrives whole.
        """

        def lose() -> None:
            self._loses_answers = True

        self._tell(lose)

    def _drop(self) -> None:
        self._loses_answers = False
        super()._drop()

    async def _answers(self, reader):
        while True:
            try:
                header = await reader.readexactly(_FRAME_HEADER)
                length = int.from_bytes(header[:3], "big")
                frame = header + await reader.readexactly(length)
            except asyncio.IncompleteReadError:
                return
            await self._flows.wait()
            if not (self._loses_answers and header[3] in _ANSWERS):
                yield frame


def _reset(writer) -> None:
    """Ends a connection by RST."""
    try:
        sock = writer.get_extra_info("socket")
        linger = struct.pack("ii", 1, 0)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    except OSError:
        pass
    writer.transport.abort()
