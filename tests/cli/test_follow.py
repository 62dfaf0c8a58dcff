"""`limo-hog follow` and `limo-hog score`, as a user types them."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from limo_hog.cli.main import main
from limo_hog.follow.control.naming import controller_named
from limo_hog.follow.sense.detectors import detector_named
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


def test_the_score_card_on_standard_output_has_every_figure_of_the_contract(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["follow", "--scenario", "followable", "--seconds", "1", "--json", "-"]) == 0
    card = json.loads(capsys.readouterr().out)
    assert set(KEYS) <= set(card)
    assert card["controller"] == "tracking"
    assert card["seconds"] == 1.0
    assert 0 <= card["in_view"] <= 1


def test_another_robot_is_the_controllers_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("camera_x = 0.2\ncamera_z = 0.25\nfield_of_view = 1.047\nhalf_length = 0.25\n")
    assert main(["follow", "--robot", str(path), "--scenario", "followable", "--seconds", "3", "--json", "-"]) == 0
    card = json.loads(capsys.readouterr().out)
    controller, detector = controller_named("tracking", 1.5), detector_named("hog")
    same = score(run_episode(Scenario.load("followable", path), controller, detector, 3.0, 0)).to_json()
    for figure in ("distance_mean_m", "path_m", "modes", "reasons", "critics"):
        assert card[figure] == same[figure]


def test_without_json_a_person_reads_the_card(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["follow", "--scenario", "empty", "--seconds", "0.5", "--controller", "approach"]) == 0
    out = capsys.readouterr().out
    assert "empty · approach · hog · seed 0" in out
    assert "no person detected" in out


def test_the_widest_card_fits_into_a_terminal_of_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["follow", "--scenario", "followable", "--seconds", "0.5", "--json", "-"]) == 0
    card = ScoreCard(**json.loads(capsys.readouterr().out))
    wide = replace(card, lost=11, found_again=1.0, pixel_error_mean=120.0, pixel_error_p95=240.0, kept_m=1.56)
    wide = replace(wide, intrusion_personal=1.0, time_to_find_again_s=12.3, path_m=123.4, mean_abs_domega=0.123)
    screen = Console(width=80, record=True, file=io.StringIO())
    screen.print(picture(wide))
    text = screen.export_text()
    assert "…" not in text
    for shown in ("first detected", "target lost       11×", "100.0 %", "personal 100.0 %"):
        assert shown in text


def test_score_compares_controllers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = tmp_path / "score.json", tmp_path / "score.png"
    command = ["score", "--scenario", "empty", "followable", "--controller", "proxemic", "tracking", "--seeds", "2"]
    assert main([*command, "--seconds", "0.3", "--workers", "2", "--json", str(out), "--plot", str(picture)]) == 0
    result = json.loads(out.read_text())
    assert [(run["scenario"], run["controller"], run["seed"]) for run in result["runs"]] == [
        (scenario, controller, seed)
        for scenario in ("empty", "followable")
        for controller in ("proxemic", "tracking")
        for seed in (0, 1)
    ]
    assert result["summary"][2]["measures"]["in_view"]["mean"] == 1.0
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "followable" in capsys.readouterr().out


def test_score_writes_a_line_for_each_run_from_the_first_seed_on(tmp_path: Path) -> None:
    table, out = tmp_path / "score.csv", tmp_path / "score.json"
    command = ["score", "--scenario", "empty", "--controller", "approach", "--seconds", "0.2", "--workers", "1"]
    assert main([*command, "--seeds", "2", "--seed-start", "7", "--csv", str(table), "--json", str(out)]) == 0
    with table.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    cards = json.loads(out.read_text())["runs"]
    assert [row["seed"] for row in rows] == ["7", "8"]
    for row, card in zip(rows, cards, strict=True):
        for name, text in row.items():
            assert text == ("" if card[name] is None else str(card[name]))
        assert len(row["scenario_hash"]) == 16
        assert row["code_version"].startswith("limo-hog ")
    assert set(cards[0]) - set(rows[0]) == {"modes", "reasons", "critics"}


def test_score_compares_with_one_of_the_controllers_run_by_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "score.json"
    command = ["score", "--scenario", "empty", "followable", "--controller", "approach", "pursuit", "ppo"]
    command += ["--against", "approach", "--seeds", "2", "--seconds", "1.2", "--workers", "1", "--json", str(out)]
    assert main(command) == 0
    result = json.loads(out.read_text())
    path = {(run["scenario"], run["controller"], run["seed"]): run["path_m"] for run in result["runs"]}
    assert all(path["followable", name, seed] > 0 for name in ("approach", "pursuit") for seed in (0, 1))
    assert [(one["scenario"], one["controller"], one["pairs"]) for one in result["comparison"]] == [
        ("empty", "pursuit", 2),
        ("empty", "ppo", 2),
        ("followable", "pursuit", 2),
        ("followable", "ppo", 2),
        ("all", "pursuit", 4),
        ("all", "ppo", 4),
    ]
    view = {(run["controller"], run["seed"]): run["pixel_error_mean"] for run in result["runs"] if run["in_view"]}
    wanted = sum(view["pursuit", seed] - view["approach", seed] for seed in (0, 1)) / 2
    assert result["comparison"][2]["differences"]["pixel_error_mean"]["mean"] == pytest.approx(wanted)
    assert "minus approach" in capsys.readouterr().out


def test_a_suite_is_summed_up_by_group(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    v1 = Suite.load("v1")
    short = replace(v1, seconds=0.2, scenarios=(v1.scenarios[0], v1.scenarios[1], v1.scenarios[-1]))
    monkeypatch.setattr(Suite, "load", staticmethod(lambda _: short))
    out, picture = tmp_path / "score.json", tmp_path / "score.png"
    command = ["score", "--suite", "v1", "--controller", "approach", "--seeds", "1", "--workers", "1"]
    assert main([*command, "--json", str(out), "--plot", str(picture)]) == 0
    result = json.loads(out.read_text())
    assert [run["scenario"] for run in result["runs"]] == ["stroll", "patrol", "clutter"]
    assert {run["seconds"] for run in result["runs"]} == {0.2}
    assert [(one["scenario"], one["runs"]) for one in result["groups"]] == [("plain", 2), ("places", 1), ("all", 3)]
    assert picture.read_bytes().startswith(b"\x89PNG")
    shown = capsys.readouterr().out
    assert "plain" in shown
    assert "places" in shown
