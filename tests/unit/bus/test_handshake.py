"""Several sessions behind one endpoint are told apart by name."""

from __future__ import annotations

import asyncio

import pytest

from elys.bus.session import Session
from elys.bus.transports.loopback import LoopbackBroker
from elys.common.errors import BusError, ConnectionLost


async def test_of_several_sessions_the_named_one_is_joined_and_who_names_none_hears_which_there_are() -> None:
    broker = LoopbackBroker()
    hosts = [
        await Session.host(broker.listen(), name=name, kind="simulation", epoch=epoch)
        for epoch, name in enumerate(("yard", "meadow"), 1)
    ]
    for epoch, name in enumerate(("yard", "meadow"), 1):
        joined = await Session.join(broker.connect(), kind="tool", name=name)
        assert (joined.name, joined.epoch) == (name, epoch)
        await joined.close()
    with pytest.raises(BusError, match="several sessions are here, meadow, yard: name one with --session NAME"):
        await Session.join(broker.connect(), kind="tool")
    with pytest.raises(ConnectionLost, match="there is no session forest here; there is meadow, yard: name one"):
        await Session.join(broker.connect(), kind="tool", name="forest", timeout=0.05)
    await hosts[0].close()
    joined = await Session.join(broker.connect(), kind="tool")
    assert joined.name == "meadow"
    await joined.close()
    await hosts[1].close()


async def test_one_world_that_restarts_beside_another_is_joined_again() -> None:
    broker = LoopbackBroker()
    other = await Session.host(broker.listen(), name="meadow", kind="simulation", epoch=5)
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=1)
    joined = await Session.join(broker.connect(), kind="tool", name="yard")
    told: list[bool] = []
    joined.on_link(told.append)
    await host.close()
    await until_told(told, 1)
    host = await Session.host(broker.listen(), name="yard", kind="simulation", epoch=2)
    await until_told(told, 2)
    assert (told, joined.name, joined.epoch) == ([False, True], "yard", 2)
    for session in (joined, host, other):
        await session.close()


async def until_told(told: list[bool], count: int) -> None:
    while len(told) < count:
        await asyncio.sleep(0.005)
