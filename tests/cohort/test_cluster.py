"""A Dask cluster of two workers, one killed in the middle: nothing lost, nothing kept twice."""

import os
import signal
from collections import Counter

import pytest
from cohort.fakes import calls, quick, studies

from fes_pin.cohort.processes import on_cluster
from fes_pin.cohort.run import run_cohort
from fes_pin.data.errors import InputError

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster():
    made = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50)
    with made:
        yield made


@pytest.mark.filterwarnings("ignore")
def test_a_worker_that_is_killed_costs_no_study(tmp_path, cluster):
    names = [f"f{k:02d}" for k in range(12)]
    places, told = studies(tmp_path / "in", names), []
    with distributed.Client(cluster, set_as_default=False) as client:
        victim = next(iter(client.run(os.getpid).values()))

    def told_or_killed(_share, words):
        told.append(words.rpartition(", ")[2])
        if len(told) == 3:
            os.kill(victim, signal.SIGKILL)

    made = run_cohort(
        [places], tmp_path / "out", scheduler=cluster.scheduler_address, progress=told_or_killed, run=quick
    )
    assert [r["study"] for r in made.studies] == names and not made.failed
    assert Counter(told) == Counter(names)
    assert set(calls(places)) == set(names)
    assert str(victim) in "".join(p.read_text() for p in places.glob("*/calls"))  # it had worked
    again = run_cohort([places], tmp_path / "out", scheduler="tcp://127.0.0.1:1", run=quick)
    assert len(again.studies) == 12  # nothing left to do: no scheduler is asked


def test_a_scheduler_that_is_not_there_is_one_line(monkeypatch):
    monkeypatch.setattr("fes_pin.cohort.processes.PATIENCE_S", "1s")
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        next(on_cluster([(None, "")], "tcp://127.0.0.1:9", quick))
