"""A figure of a person with a skeleton, and clips for it, made by code: `figure.glb` beside this file.

It is 1.75 m high, stands on the ground and looks along -z. Legs are bent so that a foot on the ground stays where it is while the
hips go on at an even speed: what is seen of a walk and what root motion makes of it agree. `python -m elys.samples.figure` writes
the file anew.
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from elys.common.assets.gltf_writing import GltfModel
from elys.common.math import quaternion
from elys.samples.figure_body import JOINTS, body

FILE: Final = Path(__file__).with_name("figure.glb")
FRAMES: Final = 24  # of a clip, and the first again
_THIGH, _SHIN = 0.43, 0.43  # [m]
_ANKLE: Final = 0.08  # [m] above the sole
_X: Final = (1.0, 0.0, 0.0)

Pose = dict[str, NDArray[np.float64]]  # rotations by joint
Floats = NDArray[np.float64]


class Gait(NamedTuple):
    """How somebody goes: lengths in m, angles in rad, `stance` the part of a round that a foot is on the ground.

    Attributes:
        half: how far before and behind the hip a foot is on the ground. bob: of the hips, `low` of their middle.
        turn: about the vertical in a round, to the left.
    """

    duration: float
    stance: float
    half: float
    lift: float
    low: float
    bob: float
    lowest: float
    arms: float
    elbows: float
    lean: float
    turn: float = 0.0

    @property
    def stride(self) -> float:
        """How far a round leads [m]."""
        return 2.0 * self.half / self.stance


WALK: Final = Gait(1.0, 0.62, 0.37, 0.10, -0.05, 0.015, 0.0, 0.45, 0.30, 0.03)
RUN: Final = Gait(0.64, 0.38, 0.42, 0.30, -0.10, 0.045, 0.19, 0.80, 1.50, 0.20)
WALK_ROUND: Final = WALK._replace(turn=math.radians(30.0))


def figure_model() -> bytes:
    """The bytes of the model."""
    model = GltfModel("ELYS figure")
    rest = {name: place for name, (_, place) in JOINTS.items()}
    nodes = {}
    for name, (parent, place) in JOINTS.items():
        local = place if parent is None else place - rest[parent]
        nodes[name] = model.add("nodes", {"name": name, "translation": np.round(local, 5).tolist()})
    for name, (parent, _) in JOINTS.items():
        if parent is not None:
            model.document["nodes"][nodes[parent]].setdefault("children", []).append(nodes[name])
    inverse = np.tile(np.eye(4, dtype=np.float32), (len(JOINTS), 1, 1))
    inverse[:, 3, :3] = [-place for place in rest.values()]  # by columns
    skin = {"joints": list(nodes.values()), "inverseBindMatrices": model.accessor(inverse), "skeleton": nodes["Hips"]}
    model.add("skins", skin)
    material = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.6}, "name": "Cloth"}
    primitive = model.primitive(body(), has_tangents=False, has_uvs=False) | {
        "material": model.add("materials", material)
    }
    mesh = model.add("meshes", {"name": "Body", "primitives": [primitive]})
    drawn = model.add("nodes", {"name": "Body", "mesh": mesh, "skin": 0})
    model.add("scenes", {"nodes": [nodes["Hips"], drawn]})
    model.document["scene"] = 0
    for name, (duration, pose) in CLIPS.items():
        _add_clip(model, nodes, name, duration, pose)
    file = io.BytesIO()
    model.write(file)
    return file.getvalue()


def _add_clip(model: GltfModel, nodes: dict[str, int], name: str, duration: float, pose: PoseAt) -> None:
    shares = np.linspace(0.0, 1.0, FRAMES + 1)
    times = model.accessor((shares * duration).astype(np.float32), has_bounds=True)
    poses = [pose(share) for share in shares]
    made: dict[str, list[Any]] = {"channels": [], "samplers": []}

    def channel(joint: str, path: str, values: Floats) -> None:
        made["samplers"].append({"input": times, "output": model.accessor(values.astype(np.float32))})
        target = {"node": nodes[joint], "path": path}
        made["channels"].append({"sampler": len(made["samplers"]) - 1, "target": target})

    moves = [place for place, _ in poses]
    if any(place is not None for place in moves):
        channel("Hips", "translation", JOINTS["Hips"][1] + np.array(moves))
    for joint in JOINTS:
        turns = np.array([turns.get(joint, quaternion.IDENTITY) for _, turns in poses])
        if any(joint in turns for _, turns in poses):
            channel(joint, "rotation", _continuous(turns))
    model.add("animations", {"name": name, **made})


PoseAt = Callable[[float], tuple[Floats | None, Pose]]


def _going(gait: Gait) -> PoseAt:
    def pose(share: float) -> tuple[Floats, Pose]:
        height = gait.low - gait.bob * math.cos(4.0 * math.pi * (share - gait.lowest))
        sway = math.sin(2.0 * math.pi * share)
        turns: Pose = {}
        for side, phase in (("L", share), ("R", share + 0.5)):
            ahead, up, tilt = _foot(gait, phase % 1.0)
            thigh, knee = _leg(ahead, JOINTS["L Thigh"][1][1] + height - _ANKLE - up)
            turns |= {f"{side} Thigh": _about(_X, thigh), f"{side} Shin": _about(_X, knee)}
            turns[f"{side} Foot"] = _about(_X, tilt - thigh - knee)
            swing = -math.cos(2.0 * math.pi * (phase % 1.0)) * gait.arms
            outward = 0.09 if side == "R" else -0.09
            turns[f"{side} Arm"] = _times(_about((0.0, 0.0, 1.0), -outward), _about(_X, swing))
            turns[f"{side} Forearm"] = _about(_X, gait.elbows * (1.0 + 0.25 * swing))
        twist = 0.14 * math.cos(2.0 * math.pi * share)
        turns["Spine"] = _times(_about((0.0, 1.0, 0.0), -twist), _about(_X, -gait.lean))
        turns["Chest"] = _about((0.0, 1.0, 0.0), -0.6 * twist)
        turns["Neck"] = _times(_about((0.0, 1.0, 0.0), 0.9 * twist), _about(_X, gait.lean * 0.6))
        heading = gait.turn * share
        place = np.array((0.015 * sway, height, -gait.stride * share))
        if gait.turn:
            radius = gait.stride / gait.turn
            place[0] = -radius * (1.0 - math.cos(heading)) + 0.015 * sway * math.cos(heading)
            place[2] = -radius * math.sin(heading)
        turns["Hips"] = _about((0.0, 1.0, 0.0), heading)
        return place, turns

    return pose


def _foot(gait: Gait, phase: float) -> tuple[float, float, float]:
    """How far ahead of the hip a foot is, how high [m], and how much its toes point up [rad]."""
    if phase < gait.stance:
        share = phase / gait.stance
        roll = max(0.0, (share - 0.6) / 0.4)
        return gait.half * (1.0 - 2.0 * share), 0.05 * roll * roll, 0.25 * max(0.0, 1.0 - 5.0 * share) - 0.55 * roll
    share = (phase - gait.stance) / (1.0 - gait.stance)
    eased = share * share * (3.0 - 2.0 * share)
    lift = gait.lift * math.sin(math.pi * share) + 0.05 * (1.0 - share)
    return gait.half * (2.0 * eased - 1.0), lift, -0.55 + 0.8 * eased


def _leg(ahead: float, down: float) -> tuple[float, float]:
    """Angles of hip and knee [rad] that bring the ankle there, as far as the leg reaches; law of cosines."""
    length = min(math.hypot(ahead, down), 0.999 * (_THIGH + _SHIN))
    at_hip = math.acos((_THIGH**2 + length**2 - _SHIN**2) / (2.0 * _THIGH * length))
    at_knee = math.acos((_THIGH**2 + _SHIN**2 - length**2) / (2.0 * _THIGH * _SHIN))
    return math.atan2(ahead, down) + at_hip, at_knee - math.pi


def _standing(height: float, sway: float = 0.0) -> tuple[Floats, Pose]:
    """On both feet, the hips `height` [m] above where they rest and `sway` beside."""
    turns: Pose = {}
    tilt = math.atan2(sway, 0.84)
    for side in "LR":
        thigh, knee = _leg(0.0, JOINTS["L Thigh"][1][1] + height - _ANKLE)
        turns[f"{side} Thigh"] = _times(_about((0.0, 0.0, 1.0), -tilt), _about(_X, thigh))
        turns[f"{side} Shin"] = _about(_X, knee)
        turns[f"{side} Foot"] = _times(_about(_X, -thigh - knee), _about((0.0, 0.0, 1.0), tilt))
    return np.array((sway, height, 0.0)), turns


def _idle(share: float) -> tuple[Floats, Pose]:
    breath = math.sin(2.0 * math.pi * share)
    place, turns = _standing(-0.012 + 0.004 * breath, 0.012 * math.sin(2.0 * math.pi * share + 1.0))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        turns[f"{side} Arm"] = _about((0.0, 0.0, 1.0), sign * (0.08 + 0.015 * breath))
        turns[f"{side} Forearm"] = _about(_X, 0.2)
    turns["Chest"] = _about(_X, 0.02 * breath)
    turns["Neck"] = _about((0.0, 1.0, 0.0), 0.12 * math.sin(2.0 * math.pi * share))
    return place, turns


def _dance(share: float) -> tuple[Floats, Pose]:
    beat, half = math.cos(4.0 * math.pi * share), math.sin(2.0 * math.pi * share)
    place, turns = _standing(-0.07 + 0.05 * beat, 0.09 * half)
    turns["Spine"] = _about((0.0, 0.0, 1.0), -0.12 * half)
    turns["Chest"] = _times(_about((0.0, 1.0, 0.0), 0.35 * half), _about((0.0, 0.0, 1.0), 0.18 * half))
    turns["Neck"] = _times(_about(_X, -0.12 * beat), _about((0.0, 0.0, 1.0), -0.1 * half))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        up = 0.5 + 0.5 * sign * half
        up = up * up * (3.0 - 2.0 * up)
        turns[f"{side} Arm"] = _times(_about((0.0, 0.0, 1.0), sign * (0.25 + 2.2 * up)), _about(_X, 0.3 + 0.3 * up))
        turns[f"{side} Forearm"] = _times(_about(_X, 1.2 - 0.8 * up), _about((0.0, 0.0, 1.0), sign * 0.3))
    return place, turns


def _jump(share: float) -> tuple[Floats, Pose]:
    crouch = math.sin(math.pi * min(share / 0.3, 1.0)) + 0.6 * math.sin(math.pi * max((share - 0.75) / 0.25, 0.0))
    flight = math.sin(math.pi * min(max((share - 0.3) / 0.45, 0.0), 1.0))
    place, turns = _standing(-0.012 - 0.22 * crouch)
    place[1] += 0.45 * flight
    turns["Spine"] = _about(_X, -0.5 * crouch)
    for side, sign in (("L", 1.0), ("R", -1.0)):
        turns[f"{side} Arm"] = _times(_about((0.0, 0.0, 1.0), sign * 0.15), _about(_X, 2.6 * flight - 0.7 * crouch))
        turns[f"{side} Forearm"] = _about(_X, 0.3)
    return place, turns


def _wave(share: float) -> tuple[None, Pose]:
    swing = math.sin(4.0 * math.pi * share)
    return None, {
        "R Arm": _about((0.0, 0.0, 1.0), -2.3),
        "R Forearm": _about((0.0, 0.0, 1.0), -0.45 + 0.5 * swing),
        "R Hand": _about((0.0, 0.0, 1.0), 0.25 * swing),
    }


CLIPS: Final[dict[str, tuple[float, PoseAt]]] = {
    "Idle": (4.0, _idle),
    "Walk": (WALK.duration, _going(WALK)),
    "Run": (RUN.duration, _going(RUN)),
    "Walk round": (WALK_ROUND.duration, _going(WALK_ROUND)),
    "Jump": (0.9, _jump),
    "Dance": (1.2, _dance),
    "Wave": (1.4, _wave),
}


def _about(axis: tuple[float, float, float], angle: float) -> Floats:
    return np.asarray(quaternion.from_axis_angle(axis, angle), np.float64)


def _times(first: Floats, second: Floats) -> Floats:
    return np.asarray(quaternion.multiply(first, second), np.float64)


def _continuous(turns: Floats) -> Floats:
    """The same turns, each with the sign that is nearer to the one before."""
    signs = np.append(1.0, np.where((turns[1:] * turns[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    return np.asarray(turns * np.cumprod(signs)[:, None], np.float64)


if __name__ == "__main__":
    FILE.write_bytes(figure_model())
