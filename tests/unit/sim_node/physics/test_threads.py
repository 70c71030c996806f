"""Several threads at one step: the same bits come out as of one."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from elys.common.errors import PhysicsError
from elys.samples.rigid_cases import CROWDS
from elys.sim_node.physics import BOX, KINEMATIC, PLANE, SPHERE, STATIC, PhysicsSettings, PhysicsWorld, plan
from elys.sim_node.physics.kernels import solver
from elys.sim_node.physics.kernels.team import give_up, meet, new_team, share
from elys.sim_node.physics.team import Team

DT = 1.0 / 60.0
CUBES = 300


def crowded_world(threads: int) -> PhysicsWorld:
    """What needs every kind of taking turns: a heap large enough to share, a platform, joints, balls that bounce."""
    world = PhysicsWorld(PhysicsSettings(threads=threads))
    world.add_bodies([1], motion=STATIC)
    world.add_colliders([1], shape=PLANE)
    world.add_bodies([2], motion=KINEMATIC, position=[0, 0.25, 0], linear_velocity=[0.3, 0, 0])
    world.add_colliders([2], size=[[8, 0.5, 8]])
    cubes = np.arange(10, 10 + CUBES)
    place = np.stack([cubes % 7, 1 + (cubes // 49), cubes // 7 % 7], axis=1) * [1.02, 1.01, 1.02] - [3, 0, 3]
    world.add_bodies(cubes, position=place)
    world.add_colliders(
        cubes, shape=np.where(cubes % 5 == 0, SPHERE, BOX), restitution=np.where(cubes % 5 == 0, 0.5, 0.0)
    )
    world.add_joints(np.arange(1, 20), kind="ball", entity_a=cubes[:19], entity_b=cubes[1:20])
    return world


@pytest.fixture(autouse=True)
def _share_early(monkeypatch):
    """Lets threads share what is too small to be worth it."""
    monkeypatch.setattr(plan, "ENOUGH", 1)


def test_two_threads_reach_the_same_bits(monkeypatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1}, raising=False)
    alone, together = crowded_world(1), crowded_world(2)
    assert together._team.threads == 2
    for _ in range(90):
        alone.step(DT)
        together.step(DT)
        assert together.state_hash() == alone.state_hash()
    batches = int(together._room.spans["last"].max())
    assert batches >= 2 * solver.ENOUGH  # else nothing was shared


def test_three_threads_reach_the_same_bits_too(monkeypatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1, 2}, raising=False)
    scene = CROWDS["pile-1000"].build().bodies
    hashes = []
    for threads in (1, 3):
        world = PhysicsWorld(PhysicsSettings(threads=threads))
        entities = np.arange(1, 1 + len(scene.motion))
        world.add_bodies(entities, motion=scene.motion, position=scene.position, rotation=scene.rotation)
        world.add_colliders(entities, shape=scene.shape, size=scene.size)
        for _ in range(70):
            world.step(DT)
        hashes.append(world.state_hash())
    assert hashes[0] == hashes[1]


def test_shares_hold_everything_once() -> None:
    for first, last, threads in ((0, 10, 3), (5, 6, 4), (7, 7, 2), (0, 1000, 7)):
        shares = [share(first, last, thread, threads) for thread in range(threads)]
        assert [i for begin, end in shares for i in range(begin, end)] == list(range(first, last))


def test_nobody_passes_before_all_have_come() -> None:
    team, threads, rounds = new_team(), 3, 200
    counts = np.zeros((threads, rounds), np.int64)
    seen = np.zeros((threads, rounds), np.int64)

    def work(thread: int) -> None:
        for number in range(rounds):
            counts[thread, number] = 1
            meet(team, threads)
            seen[thread, number] = counts[:, number].sum()

    workers = [threading.Thread(target=work, args=(thread,)) for thread in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert (seen == threads).all()


def test_a_signal_in_one_thread_leaves_no_other_waiting(monkeypatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0, 1}, raising=False)
    team = Team(2)

    def work(table, thread: int, threads: int) -> None:
        if thread == 0:
            raise KeyboardInterrupt
        meet(table, threads)

    with pytest.raises(KeyboardInterrupt):
        team.run(work)
    heard = []

    def answer(table, thread: int, threads: int) -> None:
        heard.append(thread)
        meet(table, threads)

    team.run(answer)
    assert sorted(heard) == [0, 1]


def test_who_is_given_up_waits_no_more() -> None:
    team = new_team()
    give_up(team)
    meet(team, 2)


def test_no_more_threads_than_processors(monkeypatch) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda pid: {0}, raising=False)
    assert Team(8).threads == 1


@pytest.mark.parametrize("threads", [0, -1, 65])
def test_a_number_of_threads_that_cannot_be_is_refused(threads: int) -> None:
    with pytest.raises(
        PhysicsError, match=r"PhysicsSettings\.threads must be (from 1 to 64|a finite number of 0 or more)"
    ):
        PhysicsSettings(threads=threads)
