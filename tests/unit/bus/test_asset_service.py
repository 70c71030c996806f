"""Assets asked for over the bus."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

import pytest

from elys.bus import topics
from elys.bus.asset_service import AssetClient, AssetOffer, cache_directory, open_asset_cache, serve_assets
from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.assets.store import PREFIX, AssetStore, reference_of
from elys.common.errors import AssetError, MessageError, RequestError


async def pair() -> tuple[Session, Session]:
    broker = LoopbackBroker()
    host = await Session.host(broker.listen(), name="s", kind="simulation", epoch=1)
    return host, await Session.join(broker.connect(), kind="render")


async def close(*sessions: Session) -> None:
    for session in sessions:
        await session.close()


async def test_concurrent_requests_share_one_query_and_the_answer_is_kept(tmp_path: Path) -> None:
    host, joined = await pair()
    store = AssetStore()
    reference = store.put(b"mesh bytes", kind="mesh")
    asked: list[str] = []

    async def answer(request: bytes, key: str) -> bytes:
        asked.append(key)
        return store.get(PREFIX + key)

    host.serve(topics.ASSET, answer)
    client = AssetClient(joined, AssetStore(tmp_path))
    assert await asyncio.gather(*(client.fetch(reference) for _ in range(5))) == [b"mesh bytes"] * 5
    assert await client.fetch(reference) == b"mesh bytes"
    assert asked == [reference.removeprefix(PREFIX)]
    assert AssetStore(tmp_path).get(reference) == b"mesh bytes"
    await close(joined, host)


async def test_what_the_host_lacks_or_falsifies_is_refused() -> None:
    host, joined = await pair()
    stop = serve_assets(host, AssetStore())
    client = AssetClient(joined, AssetStore())
    reference = reference_of(b"wanted")
    with pytest.raises(RequestError, match="there is no asset"):
        await client.fetch(reference)
    with pytest.raises(AssetError, match="names no asset"):
        await client.fetch("../../etc/passwd")
    stop()

    async def lie(request: bytes, key: str) -> bytes:
        return b"something else"

    host.serve(topics.ASSET, lie)
    with pytest.raises(MessageError, match="other content"):
        await client.fetch(reference)
    await close(joined, host)


async def test_a_damaged_cache_file_is_asked_for_again(tmp_path: Path) -> None:
    host, joined = await pair()
    store = AssetStore()
    serve_assets(host, store)
    reference = store.put(b"content", kind="image")
    (tmp_path / reference.removeprefix(PREFIX)).write_bytes(b"damaged")
    assert await AssetClient(joined, AssetStore(tmp_path)).fetch(reference, kind="image") == b"content"
    await close(joined, host)


def test_the_cache_stays_below_its_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path))
    store = open_asset_cache()
    references = [store.put(bytes([index]) * 100, kind="mesh") for index in range(4)]
    for age, reference in enumerate(references):
        os.utime(cache_directory() / reference.removeprefix(PREFIX), (age, age))
    kept = open_asset_cache(max_size=250)
    assert [kept.has(reference) for reference in references] == [False, False, True, True]


async def test_the_host_is_given_what_it_lacks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ELYS_CACHE_DIR", str(tmp_path))
    host, joined = await pair()
    store, mine = AssetStore(), AssetStore()
    stop = serve_assets(host, store)
    offer = AssetOffer(joined)
    known = store.put(b"known to the host", kind="mesh")
    assert await offer.bring(known, mine)
    reference = mine.put(b"in my hands", kind="mesh")
    assert await offer.bring(reference, mine)
    assert store.get(reference) == b"in my hands"
    cached = AssetStore(cache_directory()).put(b"in this machine's cache", kind="image")
    assert await offer.bring(cached, mine)
    assert store.has(cached)
    assert not await offer.bring(reference_of(b"nowhere"), mine)
    with pytest.raises(RequestError, match="is other content"):
        await joined.request(topics.ASSET_OFFER, b"a lie", key=reference_of(b"the truth").removeprefix(PREFIX))
    assert not store.has(reference_of(b"the truth")) and not store.has(reference_of(b"a lie"))
    stop()
    await close(joined, host)
