"""Many runs: cards belong to their runs and are summed up by textbook; workers end in time; suites are frozen."""

import dataclasses
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student
from scipy.stats import ttest_1samp
from tests.sim.logs import card, person, step, there

from limo_sim.run import suite as suites
from limo_sim.run.arena import Arena
from limo_sim.run.provenance import code_version, scenario_hash
from limo_sim.run.score import ScoreCard
from limo_sim.run.suite import Suite
from limo_sim.run.sweep import Run, compare, estimate, in_processes, play, summarise
from limo_sim.world.scenario import Camera, Scenario
from limo_sim.world.schema import ScenarioError


def test_every_card_belongs_to_its_run_whatever_the_scenario_calls_itself(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('name = "another name"\n')
    runs = [Run(str(tmp_path / "mine.toml"), "proxemic", "hog", 0, 0.2, 1.8)]
    runs += [Run("workshop", "approach", "hog", 1, 0.4), Run("empty", "proxemic", "hog", 2, 0.1)]
    cards = dict(in_processes(play, runs, 1))
    assert set(cards) == set(runs)
    told = [(cards[run].scenario, cards[run].target_m, cards[run].seed) for run in runs]
    assert told == [("another name", 1.8, 0), ("workshop", None, 1), ("empty", 1.5, 2)]


def _stat(number: int | str) -> list[str]:
    """What Linux says of a process that runs, after its name; nothing of one that has ended."""
    with suppress(OSError):
        words = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()
        return words if words[0] != "Z" else []
    return []


def _processes_of(parent: int) -> set[int]:
    """The children of a process, and theirs."""
    children = [int(one.name) for one in Path("/proc").glob("[0-9]*") if _stat(one.name)[1:2] == [str(parent)]]
    return {*children, *(number for child in children for number in _processes_of(child))}


@contextmanager
def _scoring(*more: str) -> Iterator[tuple[subprocess.Popen[str], set[int]]]:
    """`limo-hog score` at work with two workers that play, and its processes."""
    command = [sys.executable, "-m", "limo_hog", "score", "--scenario", "empty", "--controller", "approach", *more]
    with subprocess.Popen([*command, "--workers", "2"], stderr=subprocess.PIPE, text=True) as child:
        until = time.monotonic() + 60
        while len(busy := {one for one in _processes_of(child.pid) if _seconds_of(one) > 2.5}) < 2:
            assert time.monotonic() < until and child.poll() is None
            time.sleep(0.1)
        yield child, busy
        child.kill()


def _seconds_of(number: int) -> float:
    """Processor time of a process [s]; importing all it needs takes about two."""
    return sum(map(int, _stat(number)[11:13])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_workers_end_with_their_parent_whatever_ends_it(number: signal.Signals) -> None:
    with _scoring("--seeds", "20", "--seconds", "3000") as (child, workers):
        began = time.monotonic()
        child.send_signal(number)
        assert child.wait(20) == (-number if number == signal.SIGKILL else 128 + number)
        while any(map(_stat, workers)):
            assert time.monotonic() - began < 3.0
            time.sleep(0.05)
        assert child.stderr is not None
        # After SIGKILL Python's own tracker of semaphores says that it cleaned up.
        assert number == signal.SIGKILL or child.stderr.read().splitlines() == ["limo-hog: stopped"]


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
def test_finished_runs_are_kept_when_a_worker_or_score_ends(stop: signal.Signals, tmp_path: Path) -> None:
    outputs = ["--json", str(tmp_path / "s.json"), "--csv", str(tmp_path / "s.csv")]
    with _scoring("--seeds", "300", "--seconds", "2", *outputs) as (child, workers):
        time.sleep(2.0)
        os.kill(min(workers) if stop == signal.SIGKILL else child.pid, stop)
        began = time.monotonic()
        code = child.wait(60)
        # Chosen: a machine shared with other tests takes three times as long as one that is not.
        assert stop == signal.SIGKILL or time.monotonic() - began < 3.0
        assert child.stderr is not None
        (line,) = child.stderr.read().splitlines()
    runs = json.loads((tmp_path / "s.json").read_text())["runs"]
    assert 0 < len(runs) < 300 and len((tmp_path / "s.csv").read_text().splitlines()) == len(runs) + 1
    if stop == signal.SIGINT:
        assert (code, line) == (130, "limo-hog: stopped")
    else:
        assert code == 1 and line.startswith("limo-hog: a worker process was killed")
        assert f" {300 - len(runs)} of 300 runs" in line


def test_the_interval_is_students() -> None:
    values = [1.0, 2.0, 4.0, 4.5, 7.0, 2.5]
    found = estimate(values)
    half = student.ppf(0.975, 5) * np.std(values, ddof=1) / math.sqrt(6)
    assert (found.mean, found.least, found.most) == pytest.approx((3.5, 1.0, 7.0))
    assert found.interval == pytest.approx(half, rel=0.02)
    assert estimate([1.0, 2.0]).interval is not None
    assert (estimate([3.0]).interval, estimate([3.0]).is_sure) == (None, False)


def several(controller: str, figures: dict[tuple[str, int], float]) -> list[ScoreCard]:
    """Return cards by scenario and seed that differ in one figure."""
    plain = replace(card(step(0, person())), controller=controller)
    return [replace(plain, scenario=name, seed=seed, path_wrong_m=value) for (name, seed), value in figures.items()]


def test_cards_are_summed_up_by_scenario_and_controller_and_a_group_seed_by_seed() -> None:
    one = card(step(0, person()))
    summaries = summarise([one, replace(one, seed=1), replace(one, controller="other")])
    assert [(s.controller, s.runs) for s in summaries] == [("c", 2), ("other", 1)]
    assert summaries[0].measures["found_again"] is None
    cards = several("c", {("one", 0): 1.0, ("two", 0): 3.0, ("one", 1): 5.0, ("two", 1): 7.0})
    (summary,) = summarise(cards, {"one": "both", "two": "both"})
    assert (summary.scenario, summary.runs) == ("both", 4)
    # The interval is that of the seeds.
    assert summary.measures["path_wrong_m"] == estimate([2.0, 6.0])


def test_two_controllers_are_compared_run_by_run() -> None:
    # A seed that is hard for both moves both figures, not their difference.
    mine = several("mine", {("one", 0): 1.5, ("one", 1): 10.5, ("one", 2): 5.5})
    theirs = several("theirs", {("one", 0): 1.0, ("one", 1): 10.0, ("one", 2): 5.0, ("one", 3): 50.0})
    (comparison,) = compare([*mine, *theirs], "theirs")
    assert (comparison.controller, comparison.against, comparison.pairs) == ("mine", "theirs", 3)
    difference = there(comparison.differences["path_wrong_m"])
    assert (difference.mean, difference.interval) == pytest.approx((0.5, 0.0))
    assert comparison.differences["found_again"] is None
    overall = compare([*mine, *theirs], "theirs", {"one": "all"})[0]
    assert (overall.scenario, overall.differences) == ("all", comparison.differences)


@pytest.mark.parametrize("values", [[1.0, 2.0, 1.5], [-3.0, -2.5, -3.5, -2.9], [1.0, -1.0, 0.5], [0.1, 4.0, 0.2, -1.0]])
def test_a_difference_is_sure_where_students_test_rejects_that_there_is_none(values: list[float]) -> None:
    assert estimate(values).is_sure == (ttest_1samp(values, 0.0).pvalue < 0.05)


@pytest.mark.parametrize("count", [51, 201, 1001])
def test_students_quantile_is_right_to_the_third_power_of_the_degrees_of_freedom(count: int) -> None:
    values = np.random.default_rng(1).normal(0.0, 1.0, count).tolist()
    quantile = there(estimate(values).interval) / (np.std(values, ddof=1) / math.sqrt(count))
    assert quantile == pytest.approx(float(student.ppf(0.975, count - 1)), abs=5 / (count - 1) ** 3)


V1 = Suite.load("v1")


def test_the_first_suite_has_twenty_scenarios_in_four_groups() -> None:
    assert Counter(V1.groups.values()) == {"plain": 5, "senses": 5, "people": 5, "places": 5}
    assert len({entry.sha256 for entry in V1.scenarios}) == 20
    assert {path.stem for path in V1.path(V1.scenarios[0]).parent.glob("*.toml")} == set(V1.groups)


@pytest.mark.parametrize("entry", V1.scenarios, ids=lambda entry: entry.name)
def test_every_scenario_can_be_run_with_ten_seeds_and_its_people_differ(entry: suites.Entry) -> None:
    scenario = Scenario.load(V1.path(entry))
    assert scenario.summary
    assert len({Arena(scenario, seed).scenario.people for seed in range(10)}) == 10


def test_a_file_that_was_changed_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(suites._FOLDER, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(suites, "_FOLDER", tmp_path)
    assert Suite.load("v1") == V1
    file = tmp_path / "v1" / "door.toml"
    file.write_bytes(file.read_bytes().replace(b"\n", b"\r\n"))
    assert Suite.load("v1") == V1
    file.write_text(file.read_text(encoding="utf-8") + "# easier\n", encoding="utf-8")
    with pytest.raises(ScenarioError, match="unknown suite v0: want one of v1"):
        Suite.load("v0")
    with pytest.raises(ScenarioError, match=r"suite v1: door.toml has the SHA-256 .*those of another suite"):
        Suite.load("v1")


def test_the_page_of_the_benchmark_is_about_these_files() -> None:
    page = (Path(__file__).parents[3] / "docs" / "benchmark.md").read_text(encoding="utf-8")
    for entry in V1.scenarios:
        assert f"| `{entry.name}` | {Scenario.load(V1.path(entry)).summary} | `{entry.sha256[:16]}` |" in page


def test_scenarios_have_hashes_of_their_own_whatever_they_are_called() -> None:
    names = Scenario.names()
    assert len({scenario_hash(Scenario.load(name)) for name in names}) == len(names)
    workshop = Scenario.load("workshop")
    # New options leave the hashes of old scenarios alone.
    assert (scenario_hash(Scenario.load("empty")), scenario_hash(workshop)) == ("44136fa355b3678a", "f6353cf7e6222da5")
    assert scenario_hash(dataclasses.replace(workshop, name="mine", summary="")) == scenario_hash(workshop)
    assert scenario_hash(dataclasses.replace(workshop, camera=Camera(noise=1.001))) != scenario_hash(workshop)
    # What it would have left out may be said.
    told = dataclasses.replace(workshop, people=(dataclasses.replace(workshop.people[0], speed=0.75),), camera=Camera())
    assert scenario_hash(told) == scenario_hash(workshop)


def test_the_code_is_told_by_versions_and_a_hash() -> None:
    assert re.fullmatch(r"limo-hog \d+\.\d+\S*, limo-sim \d+\.\d+\S*, [0-9a-f]{16}", code_version())
