"""The animations of a glTF model as clips, and the component of its root that plays the first of them."""

from __future__ import annotations

import logging
from typing import Final

import msgspec
import numpy as np

from elys.common.assets.clip import WIDTHS, Channel, Clip, Interpolation, Property, encode_clips
from elys.common.assets.gltf_accessors import pick
from elys.common.assets.gltf_nodes import ModelImport, path_below_root
from elys.common.assets.gltf_schema import Animation, AnimationChannel
from elys.common.assets.morph_weights import MAX_TARGETS
from elys.common.errors import AssetError

logger = logging.getLogger(__name__)

MAX_CLIP_BYTES: Final = 1 << 28  # of all clips of a model: accessors are named again and again by a few bytes
_PROPERTIES: Final[dict[str, Property]] = {
    "translation": "position",
    "rotation": "rotation",
    "scale": "scale",
    "weights": "weights",
}
_INTERPOLATIONS: Final[dict[str, Interpolation]] = {"STEP": "step", "LINEAR": "linear", "CUBICSPLINE": "cubic"}


def import_animations(job: ModelImport) -> str:
    """Puts the clips of a model into the store, gives its root an Animation, and returns the reference of the clips.

    Without any that moves something, nothing happens and it is "".
    """
    size, names, clips = 0, set[str](), list[Clip]()
    for index, animation in enumerate(job.document.animations):
        name = animation.name or f"Animation {index}"
        clip = _clip(job, animation, name if name not in names else f"{name} {index}", f"animations[{index}]")
        size += sum(channel.times.nbytes + channel.values.nbytes for channel in clip.channels)
        if size > MAX_CLIP_BYTES:
            raise AssetError(f"animations[{index}]: the model's clips have more than {MAX_CLIP_BYTES >> 20} MiB")
        if clip.channels:
            names.add(clip.name)
            clips.append(clip)
    if not clips:
        return ""
    reference = job.assets.put(encode_clips(clips), kind="clips", source=f"{job.path}#clips")
    root = job.records[0]
    components = {**root.components, "Animation": {"clips": reference}}
    job.records[0] = msgspec.structs.replace(root, components=components)
    return reference


def _clip(job: ModelImport, animation: Animation, name: str, place: str) -> Clip:
    channels: dict[tuple[int, Property], list[Channel]] = {}
    for number, channel in enumerate(animation.channels):
        here = f"{place}.channels[{number}]"
        node, path = channel.target.node, channel.target.path
        if path not in _PROPERTIES or node is None:
            logger.warning("%s of %s moves %s, which is left out", here, job.path.name, path[:40])
            continue
        pick(job.document.nodes, node, f"{here}.target", "node")
        key = (node, _PROPERTIES[path])
        if key in channels:
            raise AssetError(f"{here} moves what another channel moves already")
        if node in job.rows:  # else it is in none of the scenes, or in one that is not opened
            channels[key] = _channels(job, animation, channel, here)
    together = tuple(channel for several in channels.values() for channel in several)
    return Clip(name=name.encode(errors="replace").decode(), channels=together)


def _channels(job: ModelImport, animation: Animation, channel: AnimationChannel, place: str) -> list[Channel]:
    """One channel; of weights one for each entity that draws a part of the node's mesh."""
    sampler = pick(animation.samplers, channel.sampler, place, "sampler")
    name, interpolation = _PROPERTIES[channel.target.path], _INTERPOLATIONS[sampler.interpolation]
    times = job.buffers.floats(sampler.input, f"{place}.input")
    values = job.buffers.floats(sampler.output, f"{place}.output")
    if times.ndim != 1 or times[0] < 0 or (np.diff(times) <= 0).any():
        raise AssetError(f"{place}.input must be times that rise from 0 on")
    assert channel.target.node is not None
    rows = [job.rows[channel.target.node]]
    count = len(times) * (3 if interpolation == "cubic" else 1)
    if name == "weights":
        if values.ndim != 1 or len(values) % count or not 0 < len(values) // count <= MAX_TARGETS:
            raise AssetError(f"{place}.output must hold numbers for each of {count} keys and tangents")
        rows, width = job.drawn.get(channel.target.node, []), len(values) // count
    elif values.shape != (count, WIDTHS[name]):
        raise AssetError(f"{place}.output must hold {count} vectors of {WIDTHS[name]} numbers")
    else:
        width = WIDTHS[name]
    return [
        Channel(
            target=path_below_root(job, row),
            property=name,
            interpolation=interpolation,
            times=times,
            values=values.reshape((-1, 3, width) if interpolation == "cubic" else (-1, width)),
        )
        for row in rows
    ]
