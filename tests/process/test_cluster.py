"""Sweeps on a Dask cluster of real processes, of which one is killed; and on a pool, of which one is killed."""

from __future__ import annotations

import json
import os
import signal

import pytest

from elys.common.assets.store import AssetStore
from elys.common.scene import open_scene, write_scene
from elys.lab.jobs import ClusterError, completed, workers
from elys.lab.sweep import rows
from elys.samples.stack import stack
from elys.verbs import sweep as verb

COUNT = 12


@pytest.fixture
def scene(tmp_path):
    write_scene(stack(3), tmp_path / "stack.scene.json")
    return tmp_path / "stack.scene.json"


@pytest.fixture
def cluster():
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as made:
        yield made


def test_a_lost_workers_runs_are_run_again_and_come_to_the_same(scene, cluster):
    assets = AssetStore()
    opened = open_scene(scene, assets)
    asked = [{"seed": seed} for seed in range(COUNT)]
    victim = next(iter(cluster.workers.values())).pid
    found = {}
    for place, row in rows(opened, assets, asked, duration=1.0, jitter=1e-3, cluster=cluster.scheduler_address):
        if not found:
            os.kill(victim, signal.SIGKILL)
        found[place] = row
    assert sorted(found) == list(range(COUNT))
    here = dict(rows(opened, assets, asked, duration=1.0, jitter=1e-3, processes=1))
    for place in range(COUNT):
        assert found[place]["problem"] == ""
        assert found[place]["state_hash"] == here[place]["state_hash"]


def killed_once(job: tuple[int, str]) -> int:
    """Ends its process the first time that it is asked for the number 3."""
    number, folder = job
    mark = os.path.join(folder, "killed")  # noqa: PTH118
    if number == 3 and not os.path.exists(mark):  # noqa: PTH110
        with open(mark, "w"):  # noqa: PTH123
            pass
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_a_killed_process_of_a_pool_loses_nothing(tmp_path):
    jobs = [(number, str(tmp_path)) for number in range(8)]
    assert sorted(completed(killed_once, jobs, processes=2)) == [(number, number * number) for number in range(8)]


def test_a_scheduler_that_is_not_there_is_named():
    pytest.importorskip("distributed")
    with pytest.raises(ClusterError, match="127"), workers(cluster="tcp://127.0.0.1:1"):
        pass


def test_the_command_writes_a_table_in_the_order_of_its_values(scene, tmp_path, capsys):
    verb.sweep(
        str(scene),
        vary=["seed=0..2", "gravity=1.62,9.81"],
        output=tmp_path / "rows.json",
        seconds=0.2,
        jitter=1e-3,
        jobs=2,
        cluster="",
    )
    table = json.loads((tmp_path / "rows.json").read_text())
    assert [(row["seed"], row["gravity"]) for row in table] == [(s, g) for s in range(3) for g in (1.62, 9.81)]
    assert "6 runs" in capsys.readouterr().out
