"""Prefabs over the bus: what stands in the files that a scene is made of, told by the host, whose disk they are on.

Only files are read that an entity of the scene is an instance of. Meshes and images are named by their content, as everywhere.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Final

import msgspec

from elys.bus import topics
from elys.bus.access.limits import MAX_MESSAGE_SIZE
from elys.bus.messages.scene import PrefabContent, PrefabRequest
from elys.bus.session import Session
from elys.bus.transports.transport import Closer
from elys.common.assets.store import AssetStore
from elys.common.errors import ElysError, RequestError
from elys.common.scene import EntityNode, SceneDocument, expand

KEPT: Final = 8  # prefabs, those asked for last


def serve_prefabs(session: Session, is_instanced: Callable[[str], bool]) -> Closer:
    """Answers every PREFAB request for a file of which `is_instanced` says that the scene has instances."""
    kept: OrderedDict[str, PrefabContent] = OrderedDict()
    turn = asyncio.Lock()  # one file at a time, however many are asked for

    async def answer(request: PrefabRequest, _: str) -> PrefabContent:
        if not request.path or not is_instanced(request.path):
            raise RequestError("no entity of the scene is an instance of that file")
        async with turn:
            known = kept.get(request.path)
            modified = await asyncio.to_thread(modified_at, request.path)
            if known is None or known.modified != modified:
                known = kept[request.path] = await asyncio.to_thread(read_prefab, request.path)
            kept.move_to_end(request.path)
            while len(kept) > KEPT:
                kept.popitem(last=False)
        return msgspec.structs.replace(known, records=None) if request.known == known.modified else known

    return session.serve(topics.PREFAB, answer)


def modified_at(path: str) -> float:
    """When a file was changed last [s since 1970]; -1 where there is none."""
    try:
        return Path(path).stat().st_mtime
    except (OSError, ValueError):
        return -1.0


def read_prefab(path: str) -> PrefabContent:
    """What a prefab consists of, its root first.

    Raises:
        RequestError: it cannot be read, is no prefab, or is too large for one message.
    """
    modified = modified_at(path)
    try:
        document = SceneDocument(entities=[EntityNode(prefab=path)])
        records = expand(document, directory=Path(path).parent, assets=AssetStore())
    except (ElysError, OSError) as error:
        raise RequestError(str(error).removeprefix("entities[0].prefab: ")) from error
    content = PrefabContent(modified=modified, records=tuple(records))
    size = len(msgspec.json.encode(content))
    if size > MAX_MESSAGE_SIZE - 4096:
        raise RequestError(f"{Path(path).name} has {size >> 20} MiB when it is read, more than one message may carry")
    return content
