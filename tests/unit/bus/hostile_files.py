"""Files that mean harm, or were harmed: what a seed makes of a recording, and a process that opens many with little memory.

Kinds: cut anywhere; bits flipped; pieces overwritten, taken out, doubled; lengths that lie; chunks that unpack to far more or far
less than they say; and, whole as MCAP goes, messages that are wrong: frames out of order, twice, with other counts, damaged
deltas and snapshots, unknown schemas and encodings, files of other programs, files with nothing in them.
"""

from __future__ import annotations

import io
import json
import resource
import signal
import struct
import sys
import traceback
import zlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.writer import Writer

MEMORY = 1 << 30  # [bytes] above what the process has at its start
SECONDS = 30  # of processor time for a file
MAGIC = b"\x89MCAP0\r\n"
Random = np.random.Generator
Message = tuple[str, bytes, int]


def hostile(seed: int, whole: bytes, told: list[Message], attachments: list[tuple[str, bytes]]) -> tuple[str, bytes]:
    """The name of a kind and a file of it, the same for the same seed."""
    random = np.random.default_rng(seed)
    kinds: list[Callable[[], bytes]] = [
        lambda: whole[: int(random.integers(0, len(whole)))],
        lambda: _flipped(whole, random),
        lambda: _overwritten(whole, random),
        lambda: _spliced(whole, random),
        lambda: _lying_lengths(whole, random),
        lambda: _bomb(random),
        lambda: _written(_wrong_frames(told, random), attachments, random),
        lambda: _written(_wrong_scene(told, random), attachments, random),
        lambda: _foreign(random),
        lambda: _cut_within_chunks(whole, random),
    ]
    names = ("cut", "flipped", "overwritten", "spliced", "lying", "bomb", "frames", "scene", "foreign", "unindexed")
    number = seed % len(kinds)
    return names[number], kinds[number]()


def _flipped(whole: bytes, random: Random) -> bytes:
    data = bytearray(whole)
    for _ in range(int(random.choice([1, 1, 3, 50]))):
        data[int(random.integers(8, len(data)))] ^= 1 << int(random.integers(8))
    return bytes(data)


def _overwritten(whole: bytes, random: Random) -> bytes:
    data = bytearray(whole)
    for _ in range(int(random.integers(1, 4))):
        size = int(random.choice([1, 4, 8, 500]))
        place = int(random.integers(8, len(data) - size))
        filling = random.choice([b"\0", b"\xff", b"\x7f"]) if random.random() < 0.5 else random.bytes(1)
        data[place : place + size] = bytes(filling) * size
    return bytes(data)


def _spliced(whole: bytes, random: Random) -> bytes:
    first, second = sorted(random.integers(8, len(whole), 2).tolist())
    if random.random() < 0.5:
        return whole[:first] + whole[second:]
    return whole[:second] + whole[first:]


def _records(whole: bytes) -> list[tuple[int, int, int]]:
    """Opcode, offset and length of the content of each record of a sound file."""
    found, place = [], 8
    while place + 9 <= len(whole) - 8:
        opcode, length = struct.unpack_from("<BQ", whole, place)
        found.append((opcode, place, length))
        place += 9 + length
    return found


def _lying_lengths(whole: bytes, random: Random) -> bytes:
    data = bytearray(whole)
    opcode, place, length = _records(whole)[int(random.integers(len(_records(whole))))]
    lies = [0, 1, length - 1, length + 1, 2 * length, 1 << 31, (1 << 63) - 1, (1 << 64) - 1]
    struct.pack_into("<BQ", data, place, opcode, max(0, int(lies[int(random.integers(len(lies)))])))
    return bytes(data)


def _chunk(
    unpacked: bytes, *, says: int | None = None, compression: bytes = b"zstd", packed: bytes | None = None
) -> bytes:
    if packed is None:
        packed = zstandard.ZstdCompressor().compress(unpacked)
    size = len(unpacked) if says is None else says
    content = struct.pack("<QQQI", 0, 1, size, 0) + struct.pack("<I", len(compression)) + compression
    content += struct.pack("<Q", len(packed)) + packed
    return struct.pack("<BQ", Opcode.CHUNK, len(content)) + content


def _bomb(random: Random) -> bytes:
    """Few bytes that unpack to many, or claim to."""
    channel = _record(Opcode.CHANNEL, struct.pack("<HH", 1, 0) + _text(b"state") + _text(b"x") + struct.pack("<I", 0))
    head = MAGIC + _record(Opcode.HEADER, _text(b"elys") + _text(b"x"))
    metadata = struct.pack("<I", 17) + _text(b"protocol") + _text(b"3")
    head += _record(Opcode.METADATA, _text(b"elys") + metadata)
    match int(random.integers(5)):
        case 0:  # zeros, honestly
            return head + _chunk(channel + _record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0) + bytes(300 << 20)))
        case 1:  # says little, unpacks to much
            packed = zstandard.ZstdCompressor(write_content_size=False).compress(bytes(1 << 29))
            return head + _chunk(b"", says=100, packed=packed)
        case 2:  # says more than there is
            return head + _chunk(channel, says=(1 << 62))
        case 3:  # nothing but heads of messages
            message = _record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0))
            return head + _chunk(channel + message * 3_000_000)
        case _:  # a frame in a frame, as often as bytes allow
            packed = bytes(1 << 27)
            for _ in range(3):
                packed = zstandard.ZstdCompressor().compress(packed)
            return head + _chunk(b"", says=1 << 27, packed=packed)


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(text: bytes) -> bytes:
    return struct.pack("<I", len(text)) + text


def _cut_within_chunks(whole: bytes, random: Random) -> bytes:
    """Without summary and indexes, some chunks damaged within and sound without: with no checksum, or that of the damage."""
    out = bytearray(MAGIC)
    for opcode, place, length in _records(whole):
        content = whole[place + 9 : place + 9 + length]
        if opcode == Opcode.DATA_END:
            break
        if opcode == Opcode.CHUNK and random.random() < 0.4:
            start, end, size, _ = struct.unpack_from("<QQQI", content)
            (name,) = struct.unpack_from("<I", content, 28)
            unpacked = bytearray(zstandard.ZstdDecompressor().decompress(content[40 + name :], max_output_size=size))
            for _ in range(int(random.integers(1, 6))):
                unpacked[int(random.integers(len(unpacked)))] = int(random.integers(256))
            packed = zstandard.ZstdCompressor().compress(bytes(unpacked))
            checksum = zlib.crc32(unpacked) if random.random() < 0.5 else 0
            content = (
                struct.pack("<QQQI", start, end, size, checksum)
                + _text(b"zstd")
                + struct.pack("<Q", len(packed))
                + packed
            )
        out += _record(opcode, content)
    return bytes(out)


def _wrong_frames(told: list[Message], random: Random) -> list[Message]:
    """Frames out of order, twice, or with another word in the header, log times anyhow."""
    messages = [list(message) for message in told]
    for message in messages:
        if message[0] == "state" and random.random() < 0.3:
            body = bytearray(message[1])
            word = int(random.integers(8))
            extreme = random.choice([b"\0" * 8, b"\xff" * 8, b"\x7f" * 8, random.bytes(8)])
            size = 4 if word > 5 else 8
            place = 8 * word if word < 7 else 52
            body[place : place + size] = bytes(extreme)[:size]
            message[1] = bytes(body) if random.random() < 0.8 else bytes(body[: int(random.integers(len(body)))])
        if random.random() < 0.2:
            message[2] = int(random.integers(0, 1 << 62))
    if random.random() < 0.5:
        order = random.permutation(len(messages))
        messages = [messages[index] for index in order]
    if random.random() < 0.5:
        messages += messages[: len(messages) // 2]
    return [(channel, body, now) for channel, body, now in messages]


def _wrong_scene(told: list[Message], random: Random) -> list[Message]:
    """JSON with other bytes in it, cut off, nested without end, or with another message's content."""
    made = []
    for channel, body, now in told:
        if channel != "state" and random.random() < 0.5:
            match int(random.integers(6)):
                case 0:
                    body = body[: int(random.integers(len(body) + 1))]
                case 1:
                    wrong = bytearray(body)
                    for _ in range(int(random.integers(1, 5))):
                        wrong[int(random.integers(len(wrong)))] = int(random.integers(32, 127))
                    body = bytes(wrong)
                case 2:
                    body = b"[" * 100_000
                case 3:
                    body = told[int(random.integers(len(told)))][1]
                case 4:
                    body = body.replace(b":1", b":99999999999999999999").replace(b"[0.0", b"[1e308", 3)
                case _:
                    body = random.bytes(50)
        made.append((channel, body, now))
    return made


def _written(told: list[Message], attachments: list[tuple[str, bytes]], random: Random) -> bytes:
    """A whole MCAP file with such messages, as the library writes it."""
    file = io.BytesIO()
    writer = Writer(file, chunk_size=int(random.choice([500, 20_000, 1 << 20])))
    writer.start(profile="elys", library="x")
    protocol = random.choice(["3", "3", "3", "2", "9", ""])
    writer.add_metadata("elys", {"protocol": str(protocol), "started_ns": str(random.choice(["1", "x", "9" * 40]))})
    for name, data in attachments:
        if random.random() < 0.9:
            writer.add_attachment(0, 0, name, "", data if random.random() < 0.8 else random.bytes(len(data)))
    if random.random() < 0.2:
        writer.add_attachment(0, 0, "elys/state_index.v1", "", random.bytes(44 * 7))
    schema = writer.register_schema("odd", str(random.choice(["jsonschema", "flatbuffer", ""])), random.bytes(20))
    channels = {name: writer.register_channel(name, "json", schema) for name in {channel for channel, _, _ in told}}
    channels["odd"] = writer.register_channel("odd/\x00\nchannel", "odd", schema)
    for channel, body, now in told:
        writer.add_message(channels[channel], now, body, now)
        if random.random() < 0.05:
            writer.add_message(channels["odd"], now, random.bytes(10), now)
    writer.finish()
    return file.getvalue()


def _foreign(random: Random) -> bytes:
    """Another program's file, nothing at all, or no MCAP."""
    match int(random.integers(4)):
        case 0:
            return b""
        case 1:
            return random.bytes(int(random.integers(1, 5000)))
        case 2:
            return MAGIC + random.bytes(int(random.integers(0, 5000)))
        case _:
            file = io.BytesIO()
            writer = Writer(file)
            writer.start(profile="ros2", library="x")
            schema = writer.register_schema("sensor_msgs/msg/Imu", "ros2msg", b"float64 x")
            channel = writer.register_channel("/imu", "cdr", schema)
            for now in range(int(random.integers(0, 50))):
                writer.add_message(channel, now, random.bytes(32), now)
            writer.finish()
            return file.getvalue()


# --- the process that opens them -----------------------------------------------------------------------------------


def _open_all(path: Path, folder: Path) -> dict[str, str]:
    """What each way to open a file says: "" for done, else the one sentence."""
    from elys.bus.export import export_npz
    from elys.bus.exports.model import export_glb
    from elys.bus.exports.selection import Selection
    from elys.bus.exports.tables import export_csv
    from elys.bus.recording_info import recording_info
    from elys.bus.recording_parts import cut, merge
    from elys.bus.recording_recovery import recover
    from elys.bus.run_comparison import compare
    from elys.common.errors import ElysError
    from elys.sim_node.verification import verify

    mended, part, whole = folder / "mended.mcap", folder / "part.mcap", folder / "merged.mcap"
    ways: dict[str, Callable[[], object]] = {
        "info": lambda: recording_info(path),
        "npz": lambda: export_npz(path, folder / "out.npz"),
        "csv": lambda: export_csv(path, folder / "out.csv"),
        "glb": lambda: export_glb(path, folder / "out.glb"),
        "play": lambda: _play(path),
        "recover": lambda: recover(path, mended),
        "diff": lambda: compare(path, path, curves=2),
        "cut": lambda: cut(path, part, Selection(start=0.2, end=0.5)),
        "merge": lambda: merge([path], whole),
        "verify": lambda: verify(path),
        "fork": lambda: _fork(path),
    }
    if find_spec("foxglove") is not None:
        from elys.bus.exports.foxglove_file import export_foxglove

        ways["foxglove"] = lambda: export_foxglove(path, folder / "out.foxglove.mcap")
    said = {}
    for name, way in ways.items():
        try:
            way()
            said[name] = ""
        except ElysError as error:
            said[name] = str(error)
        except Exception:
            said[name] = "CRASH " + traceback.format_exc()
    for made in (mended, part, whole):
        made.unlink(missing_ok=True)
    return said


def _fork(path: Path) -> None:
    """Becomes what a recording tells of its middle."""
    from elys.bus.recording import Recording
    from elys.sim_node.fork_point import fork_point

    with Recording(path, checked=True) as recording:
        fork_point(recording, float(recording.time[len(recording) // 2]))


def _play(path: Path) -> None:
    """Opens a file as the player does, and shows what it can from the first frame to the last and back."""
    import asyncio

    from elys.bus.player import Player
    from elys.bus.recording import Recording
    from elys.bus.session import Session
    from elys.bus.transports.loopback import LoopbackBroker

    async def run() -> None:
        with Recording(path) as recording:
            session = await Session.host(LoopbackBroker().listen(), name="x", kind="replay", epoch=1)
            try:
                player = Player(recording, session, playing=False)
                for position in range(1, len(recording)):
                    player._go_on(position)
                player._jump(0)
            finally:
                await session.close()

    asyncio.run(run())


def main(folder: Path) -> None:
    """Opens every .mcap of a folder; a JSON line of what was said of each."""
    import logging

    from elys.bus import player, recording, recording_info, recording_recovery  # noqa: F401  before memory is short
    from elys.bus.exports import foxglove_file, model, tables  # noqa: F401
    from elys.sim_node.simulation import Simulation

    Simulation().step()  # kernels are loaded

    logging.disable(logging.CRITICAL)
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MEMORY, hard))
    for path in sorted(folder.glob("*.mcap")):
        signal.setitimer(signal.ITIMER_PROF, SECONDS)  # of the processor: others may want it as well
        said = _open_all(path, folder)
        signal.setitimer(signal.ITIMER_PROF, 0)
        print(json.dumps({"file": path.name, "said": said}), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
