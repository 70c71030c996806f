"""A reader of recordings written from docs/recording-format.md alone: numpy, mcap and zstandard, nothing of ELYS."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import zstandard
from mcap.reader import make_reader

U32, I32, F32, F64 = np.uint32, np.int32, np.float32, np.float64
SIGNED = {2: np.int16, 4: np.int32, 8: np.int64}


def frames(path: Path) -> Iterator[bytes]:
    """Every frame of the channel "state" as it was on the bus, in the order of the file."""
    kept: dict[str, Frame] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(topics=["state"], log_time_order=False):
            if channel.message_encoding == "elys.state.v1":
                yield message.data
                continue
            frame = Frame(message.data, kept.get("last"), kept.get("key"))
            if frame.kind == 1:
                kept["key"] = frame
            kept["last"] = frame
            yield frame.body


class Planes:
    def __init__(self, data: bytes, place: int) -> None:
        self.data, self.place = data, place

    def take(self, size: int) -> bytes:
        self.place += size
        return self.data[self.place - size : self.place]

    def plane(self, size: int) -> np.ndarray:
        if size == 0:
            return np.zeros(0, np.uint8)
        how = self.take(1)[0]
        if how == 0:
            return np.zeros(size, np.uint8)
        if how == 1:
            return np.frombuffer(self.take(size), np.uint8)
        (length,) = struct.unpack("<I", self.take(4))
        return np.frombuffer(zstandard.decompress(self.take(length)), np.uint8)

    def numbers(self, count: int, width: int) -> np.ndarray:
        planes = [self.plane(count) for _ in range(width)]
        return np.ascontiguousarray(np.stack(planes[::-1], axis=1)).view(f"<u{width}").ravel()

    def bits(self, count: int) -> np.ndarray:
        return np.unpackbits(self.plane(-(-count // 8)), bitorder="little")[:count].astype(bool)


def ordered(values: np.ndarray) -> np.ndarray:
    bits = values.view(SIGNED[values.itemsize])
    return np.where(bits < 0, bits ^ np.iinfo(bits.dtype).max, bits)


def unordered(numbers: np.ndarray, dtype: type) -> np.ndarray:
    return ordered(numbers).view(dtype)


def unfolded(words: np.ndarray) -> np.ndarray:
    half = (words >> words.dtype.type(1)).view(SIGNED[words.itemsize])
    return np.where(words & words.dtype.type(1), ~half, half)


def finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, values.dtype.type(0))


class Frame:
    """One stored frame, unpacked. `rows` are its columns, a list: exact or in steps."""

    def __init__(self, data: bytes, last: Frame | None, key: Frame | None) -> None:
        header = data[:56]
        _, _, self.time, _, _, _, self.count, flags = struct.unpack("<QQdQQQII", header)
        kind, self.told, _, self.number, base_number = struct.unpack_from("<BBHII", data, 56)
        self.compact, self.kind = bool(kind & 128), kind & 127
        self.change = None
        if self.kind == 4:
            self.body = header + data[68:]
            return
        base = {1: None, 2: key, 3: last}[self.kind]
        assert base is None or base.number == base_number
        dt = self.time - base.time if self.kind == 3 else 0.0
        self.dt = dt if 0.0 < dt < 1.0 else 0.0
        planes = Planes(data, 68)
        self.ids = base.ids if base is not None else np.zeros(0, U32)
        if self.told & 1:
            self.ids = np.cumsum(unfolded(planes.numbers(self.count, 4)), dtype=I32).view(U32)
        before, change = self.before(base)
        which = planes.bits(self.count) if self.told & 4 else np.full(self.count, bool(self.told & 2))
        self.rows = [column.copy() for column in before]
        if self.told & 2:
            part = [column[..., which] for column in before]
            known = None if change is None else change[:, which]
            rows = self.in_steps(planes, part) if self.compact else self.exact(planes, part, known)
            for column, row in zip(self.rows, rows, strict=True):
                column[..., which] = row
            if self.dt and not self.compact:
                with np.errstate(all="ignore"):
                    self.change = self.rows[2] - before[2]
        self.tail = b""
        if self.told & 8:
            self.tail = self.read_tail(planes, base)
        elif flags & 2 and base is not None:
            self.tail = base.tail
        assert planes.place == len(data)
        self.body = b"".join((header, *self.columns(), self.ids.tobytes(), self.tail))

    def before(self, base: Frame | None) -> tuple[list[np.ndarray], np.ndarray | None]:
        if self.compact:
            kinds = ((3, I32), (None, np.uint8), (3, np.int16), (3, I32), (3, I32))
        else:
            kinds = ((3, F64), (4, F32), (3, F32), (3, F32))
        zeros = [np.zeros((width, self.count) if width else self.count, dtype) for width, dtype in kinds]
        if base is None:
            return zeros, None
        if not self.told & 1:
            return base.rows, base.change
        where = {entity: place for place, entity in reversed(list(enumerate(base.ids.tolist())))}
        rows = [(new, where[entity]) for new, entity in enumerate(self.ids.tolist()) if entity in where]
        new, old = np.array(rows, int).reshape(-1, 2).T
        change = None if base.change is None or not len(rows) else np.zeros((3, self.count), F32)
        for column, earlier in zip(zeros, base.rows, strict=True):
            column[..., new] = earlier[..., old]
        if change is not None:
            change[:, new] = base.change[:, old]
        return zeros, change

    def exact(self, planes: Planes, before: list[np.ndarray], change: np.ndarray | None) -> list[np.ndarray]:
        p0, q0, v0, w0 = before
        n, dt = p0.shape[1], self.dt

        def floats(guesses: dict[int, np.ndarray]) -> np.ndarray:
            mode = planes.take(1)[0]
            words = planes.numbers(3 * n, 4).reshape(3, n)
            if mode == 0:
                return ((words >> U32(1)) | (words << U32(31))).view(F32)
            return unordered(ordered(finite(guesses[mode]) if mode > 1 else guesses[mode]) + unfolded(words), F32)

        with np.errstate(all="ignore"):
            v1 = floats({1: v0} if change is None else {1: v0, 2: v0 + change})
            w1 = floats({1: w0})
            x, y, z, w = q0
            wx, wy, wz = (w0 + w1) * F32(dt * 0.25)
            turned = [
                x + ((wx * w + wy * z) - wz * y),
                y + ((wy * w + wz * x) - wx * z),
                z + ((wz * w + wx * y) - wy * x),
            ]
            xyz = floats({1: q0[:3], 3: np.stack(turned)})
            a, b, c = xyz.astype(F64)
            rest = 1.0 - ((a * a + b * b) + c * c)
            guess = np.copysign(np.sqrt(np.where(rest > 0.0, rest, 0.0)).astype(F32), w)
            last = unordered(ordered(guess) + unfolded(planes.numbers(n, 4)), F32)
            way = finite((v0.astype(F64) + v1) * (dt * 0.5)).ravel() if dt else np.zeros(3 * n)
            mode = planes.take(1)[0]
            short = planes.bits(3 * n) if mode == 2 else np.full(3 * n, mode == 0)
            start, p1 = p0.ravel(), np.empty(3 * n)
            moved = ordered(finite(way[short].astype(F32))) + unfolded(planes.numbers(int(short.sum()), 4))
            p1[short] = start[short] + unordered(moved, F32)
            there = ordered(finite(start[~short] + way[~short]))
            p1[~short] = unordered(there + unfolded(planes.numbers(int((~short).sum()), 8)), F64)
        return [p1.reshape(3, n), np.vstack([xyz, last[None]]), v1, w1]

    def in_steps(self, planes: Planes, before: list[np.ndarray]) -> list[np.ndarray]:
        p0, largest0, q0, v0, w0 = before
        n, dt = p0.shape[1], self.dt
        v1 = v0 + unfolded(planes.numbers(3 * n, 4)).reshape(3, n)
        w1 = w0 + unfolded(planes.numbers(3 * n, 4)).reshape(3, n)
        largest = largest0 ^ planes.numbers(n, 1)
        guess, place = q0, p0
        if dt:
            x, y, z, w = rotation_of(largest0, q0)
            wx, wy, wz = (w0 + w1).astype(F32) * F32(dt * 0.25 / 512)
            turned = np.stack(
                [
                    x + ((wx * w + wy * z) - wz * y),
                    y + ((wy * w + wz * x) - wx * z),
                    z + ((wz * w + wx * y) - wy * x),
                    w - ((wx * x + wy * y) + wz * z),
                ]
            )
            a, b, c, d = turned
            turned = turned / np.sqrt(((a * a + b * b) + c * c) + d * d)
            guess = np.empty((3, n), np.int16)
            for row in range(n):
                which = int(largest[row] & 3)
                sign = F32(-23170 if turned[which, row] < 0 else 23170)
                guess[:, row] = np.rint(np.delete(turned[:, row], which) * sign).astype(np.int16)
            place = p0 + np.rint((v0 + v1) * (dt * 0.5 * 2048 / 1024)).astype(I32)
        q1 = guess + unfolded(planes.numbers(3 * n, 2)).reshape(3, n)
        p1 = place + unfolded(planes.numbers(3 * n, 4)).reshape(3, n)
        return [p1, largest, q1, v1, w1]

    def columns(self) -> list[bytes]:
        columns = self.rows
        if self.compact:
            p, largest, q, v, w = self.rows
            columns = [p / 2048, rotation_of(largest, q), (v / 1024).astype(F32), (w / 512).astype(F32)]
        return [np.ascontiguousarray(column.T).tobytes() for column in columns]

    def read_tail(self, planes: Planes, base: Frame | None) -> bytes:
        is_alike, count = struct.unpack("<BI", planes.take(5))
        numbers = unfolded(planes.numbers(count, 4))
        if is_alike:
            numbers = numbers + ordered(np.frombuffer(base.tail, F32))
        return unordered(numbers, F32).tobytes()


def rotation_of(largest: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """[4, n] float32 of the steps of a compact recording."""
    others = steps * F32(1.0 / 23170)
    a, b, c = others
    rest = np.sqrt(np.maximum(F32(1.0) - ((a * a + b * b) + c * c), F32(0.0)))
    rotation = np.empty((4, len(largest)), F32)
    for row, which in enumerate((largest & 3).tolist()):
        sign = F32(-1.0 if largest[row] & 4 else 1.0)
        rotation[:, row] = np.insert(others[:, row], which, rest[row]) * sign
    return rotation
