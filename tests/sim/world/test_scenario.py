"""Scenarios are data, and data that cannot be run is refused by name; the people of a run are drawn from its seed."""

import dataclasses
import re
from pathlib import Path

import pytest

from limo_hog.exceptions import LimoHogError
from limo_sim.run.arena import Arena
from limo_sim.world.scenario import Camera, Furniture, Group, Mover, Person, Scenario, Vary, Wall
from limo_sim.world.schema import ScenarioError
from limo_sim.world.variants import of_run

#: What a file cannot say, " / " between its lines, and the refusal.
WRONG = """
colour = 1 → colour: unknown key, want one of name, summary, people
[camera] / rate = 10 → camera.rate: unknown key, want one of rate_hz
[camera] / rate_hz = -10 → camera.rate_hz: got -10.0, want a number in 0.5 … 50
[camera] / rate_hz = nan → camera.rate_hz: got nan, want a number in 0.5 … 50
[camera] / rate_hz = 'fast' → camera.rate_hz: got 'fast', want a number
[camera] / rate_hz = true → camera.rate_hz: got True, want a number
[camera] / drop_probability = 1.5 → camera.drop_probability: got 1.5, want a number in 0 … 1
camera = 3 → camera: got 3, want a table
people = 3 → people: got 3, want a list
[[people]] / speed = 0.5 → people[0].route: missing
[[people]] / route = [] → people[0].route: is empty
[[people]] / route = [[1, 2]] → people[0].route[0]: got 2 values, want 3
[[people]] / route = [[1, 2, -1]] → people[0].route[0]: pause -1 s, want 0 … 3600
[[people]] / route = [[2, 0, 0], [6, 0, 0]]
    → people[0].route[1]: (6, 0) is in a wall or too near one, want x and y in -4.3 … 4.3
[[people]] / route = [[0.1, 0, 0], [3, 0, 0]]
    → people[0].route[0]: is 0.00 m from the robot's centre, want at least 0.19 m
[[people]] / route = [[2, -2, 0], [2, 2, 0]] / [[furniture]] / kind = 'pillar' / x = 2 / y = 0
    → people[0].route[0]: the way to the next corner passes 0.00 m from furniture[0] (pillar)
[[furniture]] / kind = 'sofa' / x = 2 / y = 0 → furniture[0].kind: got 'sofa', want one of pillar
[[furniture]] / kind = 'chair' / x = 0.1 / y = 0 → furniture[0]: is 0.00 m from the robot's centre
[light] / sun = [0, 0, 0] → light.sun: got (0.0, 0.0, 0.0), want a direction
[robot] / x = 4.9 → robot.x: got 4.9, want a number in -4.6 … 4.6
[[people]] / route = [[2, 0, 0], [4.3, 0, 0]] / height = 1.85
    → people[0].route[1]: (4.3, 0) is in a wall or too near one, want x and y in -4.21 … 4.21
[[people]] / route = [[2, 0, 0]] / height = 2.1 → people[0].height: got 2.1, want a number in 0.6 … 2
[[people]] / route = [[2, 0, 0]] / leaves_s = nan → people[0].leaves_s: got nan, want a number in 0
[[people]] / route = [[2, 0, 0]] / arrives_s = 5 / leaves_s = 4 → people[0].leaves_s: got 4, want more than arrives_s, 5
[vary] / speed = 1 → vary.speed: got 1.0, want a number in 0 … 0.9
[vary] / clothes = 1 → vary.clothes: got 1, want bool
[room] / half = 16 → room.half: got 16.0, want a number in 1.5 … 15
[room] / half = 2 / [robot] / y = -1.8 → robot.y: got -1.8, want a number in -1.7 … 1.7
[[furniture]] / kind = 'cone' / x = 2 / y = 4.8 → furniture[0].y: got 4.8, want a number in -4.7 … 4.7
[[walls]] / start = [2, 0] / end = [2, 6] → walls[0].end[1]: got 6.0, want a number in -4.9 … 4.9
[[walls]] / start = [2, 0] → walls[0].end: missing
[[walls]] / start = [2, 0] / end = [2, 0.01] → walls[0]: is 0.01 m long, want at least 0.05 m
[[walls]] / start = [2, 0] / end = [2, 1] / thickness = 2 → walls[0].thickness: got 2.0, want a number in 0.02 … 1
[[walls]] / start = [-1, 0.1] / end = [1, 0.1] → walls[0]: is 0.05 m from the robot's centre, want at least 0.19 m
[[people]] / route = [[2, -2, 0], [2, 2, 0]] / [[walls]] / start = [1, 0] / end = [4, 0]
    → people[0].route[0]: the way to the next corner passes 0.00 m from walls[0], want at least
[room] / half = 3 / [[people]] / route = [[2.5, 0, 0]]
    → people[0].route[0]: (2.5, 0) is in a wall or too near one, want x and y in -2.4 … 2.4
[detector] / recall = 1.2 → detector.recall: got 1.2, want a number in 0 … 1
[detector] / false_rate = -1 → detector.false_rate: got -1.0, want a number in 0 … 20
[detector] / recall = 0.5 / burst_s = 0.05 → detector.burst_s: got 0.05, want at least 0.1 s
[detector] / misses_like = "hog" → detector.misses_like: got 'hog', want one of none, opencv, limo
[detector] / misses_like = "limo" / recall = 0.9
    → detector.recall: got 0.9 beside misses_like 'limo', which has its own; give one of the two
[detector] / recall = 0.1 → detector.burst_s: got 0.3, want at least 0.9 s
[camera → not TOML
[[movers]] / kind = 'sofa' / route = [[2, 0, 0]] → movers[0].kind: got 'sofa', want one of pillar
[[movers]] / kind = 'trolley' → movers[0].route: missing
[[movers]] / kind = 'trolley' / route = [[2, 0, 0]] / speed = 9 → movers[0].speed: got 9.0, want a number in 0.05 … 2
[[movers]] / kind = 'trolley' / route = [[2, 0, 0], [2, 4.6, 0]] → movers[0].route[1]: (2, 4.6) is in a wall
[[movers]] / kind = 'trolley' / route = [[0.3, 0, 0]] → movers[0].route[0]: is 0.00 m from the robot's centre
[[movers]] / kind = 'chair' / route = [[2, 0, 0]] / [walls_texture] / kind = 'silk' → walls_texture.kind: got 'silk'
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / behaviour = 'fly'
    → people[0].behaviour: got 'fly', want one of route, social_force
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / reaction = 'flee'
    → people[0].reaction: got 'flee', want one of avoid, ignore, approach, block
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / reaction = 'block'
    → people[0].reaction: got 'block', want behaviour = "social_force" with it
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / enters = [4.9, 1] → people[0].enters: got (4.9, 1.0), want behaviour
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / behaviour = 'social_force' / enters = [4.0, 1.0]
    → people[0].enters: got [4.0, 1.0], want [x, y] on an outer wall: the one or the other ±4.9
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / behaviour = 'social_force' / enters = [4.9]
    → people[0].enters: got [4.9], want [x, y] on an outer wall
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / behaviour = 'social_force' / [[walls]] / start = [0, 2] / end = [4.9, 2]
    / [[walls]] / start = [0, 2] / end = [0, 4.9]
    → people[0].route[1]: no way leads there from the first corner, want doors of at least 0.56 m
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / behaviour = 'social_force' / [[furniture]] / kind = 'pillar' / x = 3.0
    / y = 1.4 → people[0].route[0]: is 0.25 m from furniture[0] (pillar), want at least 0.35 m
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / sits = true
    → people[0].sits: got true with 2 corners, want a route of one corner
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / [[groups]] / x = 1 → groups[0].y: missing
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / [[groups]] / x = 1 / y = 4 → groups[0], one of its people.route[0]
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / [[groups]] / x = 1 / y = 2 / size = 40
    → groups[0].size: got 40, want a number in 2 … 12
[[people]] / route = [[3, 1, 0], [3, 3, 0]] / [[groups]] / x = 1 / y = 2 / count = 4
    → groups[0].count: unknown key, want one of x, y, size
"""
REFUSED: list[tuple[str, ...]] = [
    tuple(row.split(" → ")) for row in re.sub(r"\n +(?=[→/])", " ", WRONG).strip().splitlines()
]
#: Numbers of more than 64 bits, and what TOML's reader gives up on.
REFUSED += [
    (f"[{table}] / {key} = {number}", f"{table}.{key}: got a whole number of more than 64 bits")
    for table, key in (("camera", "rate_hz"), ("walls_texture", "seed"))
    for number in ("9" * 400, f"0x{'f' * 5000}")
]
REFUSED += [
    (text, "not TOML that can be read: ")
    for text in (f"[camera] / rate_hz = {'9' * 5000}", f"summary = {'[' * 5000}{']' * 5000}")
]


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", Scenario.names())
def test_every_scenario_loads_and_runs(name: str) -> None:
    scenario = Scenario.load(name)
    assert scenario.name == name and scenario.summary
    arena = Arena(scenario, 0)
    arena.step()
    assert arena.frame().image.shape == (480, 640, 3)


def test_a_file_without_a_name_is_called_by_its_own(tmp_path: Path) -> None:
    path = written(tmp_path, "[[people]]\nroute = [[2, 0, 0]]\n[camera]\nlatency_s = 0.4\n")
    person = Person(route=((2.0, 0.0, 0.0),))
    assert Scenario.load(path) == Scenario("mine", camera=Camera(latency_s=0.4), people=(person,))


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_bad_data_is_refused_with_file_key_and_range(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(written(tmp_path, text.replace(" / ", "\n")))
    assert f"mine.toml: {message}" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, LimoHogError)


def test_a_missing_file_an_unknown_name_and_a_wrong_replacement_are_refused(tmp_path: Path) -> None:
    for name, told in (
        (tmp_path / "nowhere.toml", r"nowhere\.toml: cannot be read"),
        ("wrokshop", r"^unknown scenario wrokshop: want one of bollards, .*, workshop, or a \.toml file$"),
        ("wrokshop:3", "unknown scenario wrokshop:3"),
    ):
        with pytest.raises(ScenarioError, match=told):
            Scenario.load(name)
    inside = dataclasses.replace(Scenario.load("followable"), furniture=(Furniture("cone", 0.1, 0.0),))
    with pytest.raises(ScenarioError, match="scenario 'followable': furniture"):
        Arena(inside, 0)


def test_the_page_about_the_arena_tells_the_truth(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "simulator.md").read_text(encoding="utf-8")
    scenario, *others = (
        Scenario.load(written(tmp_path, text)) for text in re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    )
    assert others
    assert scenario.camera.drop_probability == 0.3
    for name in Scenario.names():
        assert f"| `{name}` |" in page
    known = {"people[]": Person, "groups[]": Group, "furniture[]": Furniture, "walls[]": Wall, "movers[]": Mover} | {
        field.name: type(getattr(scenario, field.name)) for field in dataclasses.fields(scenario)
    }
    told = set()
    for keys in re.findall(r"^\| `(\S+\..*?)` \|", page, re.MULTILINE):
        table, names = keys.split(".")
        told |= {(table, name) for name in names.replace("`", "").split(", ")}
    for table, kind in known.items():
        if dataclasses.is_dataclass(kind):
            assert {name for owner, name in told if owner == table} == {one.name for one in dataclasses.fields(kind)}


@pytest.mark.parametrize(("table", "most"), [("people", 64), ("furniture", 256), ("groups", 64)])
def test_no_scenario_has_more_of_a_kind_than_a_run_can_bear(table: str, most: int, tmp_path: Path) -> None:
    one = {"people": "route = [[1, 1, 0]]", "furniture": 'kind = "cone"\nx = 2\ny = 2', "groups": "x = 2\ny = 2"}
    path = written(tmp_path, f"[[{table}]]\n{one[table]}\n" * (most + 1))
    with pytest.raises(ScenarioError, match=rf"mine\.toml: (people|furniture): .*want at most {most}"):
        Scenario.load(path)


ROUTE = ((2.5, -1.0, 2.0), (3.0, 1.5, 2.0))
PLAIN = Scenario(people=(Person(route=ROUTE, speed=0.4), Person(route=((-2.0, 1.0, 0.0),))))
DRAWN = dataclasses.replace(PLAIN, vary=Vary(clothes=True, height=0.1, speed=0.3, place=0.4))


def test_a_seed_draws_clothes_stature_speed_and_places_within_what_is_asked_for() -> None:
    runs = [of_run(DRAWN, seed) for seed in range(200)]
    assert runs[3] == of_run(DRAWN, 3)
    assert of_run(runs[3], 4) is runs[3]
    assert of_run(PLAIN, 1) is PLAIN
    assert len({run.people for run in runs}) == 200
    for run in runs:
        run.check()
        for person, plain in zip(run.people, PLAIN.people, strict=True):
            assert 0.9 * plain.height <= person.height <= 1.1 * plain.height
            assert 0.7 * plain.speed <= person.speed <= 1.3 * plain.speed
            for (x, y, pause), (plain_x, plain_y, plain_pause) in zip(person.route, plain.route, strict=True):
                assert max(abs(x - plain_x), abs(y - plain_y)) <= 0.4
                assert pause == plain_pause
    heights = [run.people[0].height for run in runs]
    assert max(heights) - min(heights) > 0.15 * PLAIN.people[0].height


def test_what_is_not_asked_for_stays_and_people_that_do_not_fit_are_refused() -> None:
    run = of_run(dataclasses.replace(PLAIN, vary=Vary(speed=0.5)), 5)
    assert run.people[0].speed != PLAIN.people[0].speed
    for person, plain in zip(run.people, PLAIN.people, strict=True):
        assert dataclasses.replace(person, speed=plain.speed) == plain
    tall = dataclasses.replace(DRAWN, people=tuple(Person(route=((3.0, 0.0, 0.0),), height=2.0) for _ in range(16)))
    with pytest.raises(ScenarioError, match="vary: no people that fit found"):
        of_run(tall, 0)
