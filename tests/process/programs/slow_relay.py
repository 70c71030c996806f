"""A way that carries only so much: `slow_relay.py LISTEN_PORT TARGET_PORT`, both of loopback.

A line of its input is the rate [bit/s].
"""

from __future__ import annotations

import asyncio
import sys
import threading

CHUNK = 4096  # [bytes]


class Rate:
    """What it carries in each direction now [bit/s]."""

    def __init__(self) -> None:
        self.value = float("inf")

    def listen(self) -> None:
        """Takes what is typed."""
        for line in sys.stdin:
            self.value = float(line)
            print(f"rate {self.value:g}", flush=True)


async def carry(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, rate: Rate) -> None:
    """One direction, until it ends: each piece takes its time."""
    loop = asyncio.get_running_loop()
    free = loop.time()
    try:
        while data := await reader.read(CHUNK):
            free = max(free, loop.time()) + len(data) * 8.0 / rate.value
            await asyncio.sleep(max(free - loop.time(), 0.0))
            writer.write(data)
            await writer.drain()
    except OSError:
        pass
    finally:
        writer.close()


async def main(listen: int, target: int) -> None:
    rate = Rate()
    threading.Thread(target=rate.listen, daemon=True).start()

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there_reader, there_writer = await asyncio.open_connection("127.0.0.1", target, limit=CHUNK)
        await asyncio.gather(carry(reader, there_writer, rate), carry(there_reader, writer, rate))

    server = await asyncio.start_server(accept, "127.0.0.1", listen, limit=CHUNK)
    print("relaying", flush=True)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1]), int(sys.argv[2])))
