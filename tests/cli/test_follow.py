"""`limo-hog follow` and `limo-hog score`, as a user types them."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console
from tests.answers import AnswerTo

from limo_hog.follow.control.naming import controller_named
from limo_hog.named_detectors import detector_named
from limo_sim.cli.card import picture
from limo_sim.run.episode import run_episode, score
from limo_sim.run.score import ScoreCard
from limo_sim.run.suite import Suite
from limo_sim.world.scenario import Scenario

KEYS = (
    "scenario controller detector seed seconds frames first_detection_s in_view detected best_box_wrong "
    "longest_gap_s pixel_error_mean pixel_error_p95 distance_min_m distance_mean_m distance_rms_error_m "
    "zone_intimate zone_personal zone_social zone_public contacts_person contacts_wall mean_abs_domega path_m "
    "detect_ms_p50 detect_ms_p95 render_ms_p50 real_time_factor"
).split()


def test_the_score_card_on_standard_output_has_every_figure_of_the_contract(answer_to: AnswerTo) -> None:
    card = json.loads(answer_to("follow", "--scenario", "followable", "--seconds", 1, "--json", "-").out)
    assert set(KEYS) <= set(card)
    assert (card["controller"], card["seconds"]) == ("tracking", 1.0) and 0 <= card["in_view"] <= 1


def test_another_robot_is_the_controllers_too(tmp_path: Path, answer_to: AnswerTo) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("camera_x = 0.2\ncamera_z = 0.25\nfield_of_view = 1.047\nhalf_length = 0.25\n")
    typed = ("follow", "--robot", path, "--scenario", "followable", "--seconds", 3, "--json", "-")
    card = json.loads(answer_to(*typed).out)
    controller, detector = controller_named("tracking", 1.5), detector_named("hog")
    same = score(run_episode(Scenario.load("followable", path), controller, detector, 3.0, 0)).to_json()
    for figure in ("distance_mean_m", "path_m", "modes", "reasons", "critics"):
        assert card[figure] == same[figure]


def test_without_json_a_person_reads_the_card(answer_to: AnswerTo) -> None:
    code, out, _ = answer_to("follow", "--scenario", "empty", "--seconds", 0.5, "--controller", "approach")
    assert code == 0 and "empty · approach · hog · seed 0" in out and "no person detected" in out


def test_the_widest_card_fits_into_a_terminal_of_80_columns(answer_to: AnswerTo) -> None:
    typed = ("follow", "--scenario", "followable", "--seconds", 0.5, "--json", "-")
    card = ScoreCard(**json.loads(answer_to(*typed).out))
    wide = replace(card, lost=11, found_again=1.0, pixel_error_mean=120.0, pixel_error_p95=240.0, kept_m=1.56)
    wide = replace(wide, intrusion_personal=1.0, time_to_find_again_s=12.3, path_m=123.4, mean_abs_domega=0.123)
    screen = Console(width=80, record=True, file=io.StringIO())
    screen.print(picture(wide))
    text = screen.export_text()
    wanted = ("first detected", "target lost       11×", "personal 100.0 %")
    assert "…" not in text and [shown for shown in wanted if shown not in text] == []


def test_score_writes_every_run_and_compares_controllers(tmp_path: Path, answer_to: AnswerTo) -> None:
    table, file, picture = tmp_path / "score.csv", tmp_path / "score.json", tmp_path / "score.png"
    command = ["score", "--scenario", "empty", "followable", "--controller", "approach", "pursuit", "ppo"]
    command += ["--against", "approach", "--seeds", "2", "--seed-start", "7", "--seconds", "1.2", "--workers", "2"]
    code, out, _ = answer_to(*command, "--csv", table, "--json", file, "--plot", picture)
    assert code == 0 and "followable" in out and "minus approach" in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    result = json.loads(file.read_text())
    cards, names = result["runs"], ("approach", "pursuit", "ppo")
    assert [(card["scenario"], card["controller"], card["seed"]) for card in cards] == [
        (scenario, name, seed) for scenario in ("empty", "followable") for name in names for seed in (7, 8)
    ]
    assert all(card["path_m"] > 0 for card in cards[6:10])
    with table.open(newline="", encoding="utf-8") as rows:
        for row, card in zip(csv.DictReader(rows), cards, strict=True):
            assert all(text == ("" if card[name] is None else str(card[name])) for name, text in row.items())
            assert set(card) - set(row) == {"modes", "reasons", "critics"}
            assert len(row["scenario_hash"]) == 16 and row["code_version"].startswith("limo-hog ")
    assert result["summary"][3]["measures"]["in_view"]["mean"] == 1.0
    assert [(one["scenario"], one["controller"], one["pairs"]) for one in result["comparison"]] == [
        (scenario, name, pairs)
        for scenario, pairs in (("empty", 2), ("followable", 2), ("all", 4))
        for name in names[1:]
    ]


def test_a_suite_is_summed_up_by_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer_to: AnswerTo) -> None:
    v1 = Suite.load("v1")
    short = replace(v1, seconds=0.2, scenarios=(v1.scenarios[0], v1.scenarios[1], v1.scenarios[-1]))
    monkeypatch.setattr(Suite, "load", staticmethod(lambda _: short))
    file, picture = tmp_path / "score.json", tmp_path / "score.png"
    command = ["score", "--suite", "v1", "--controller", "approach", "--seeds", "1", "--workers", "1"]
    code, out, _ = answer_to(*command, "--json", file, "--plot", picture)
    assert code == 0 and "plain" in out and "places" in out
    result = json.loads(file.read_text())
    assert [run["scenario"] for run in result["runs"]] == ["stroll", "patrol", "clutter"]
    assert {run["seconds"] for run in result["runs"]} == {0.2}
    assert [(one["scenario"], one["runs"]) for one in result["groups"]] == [("plain", 2), ("places", 1), ("all", 3)]
    assert picture.read_bytes().startswith(b"\x89PNG")
