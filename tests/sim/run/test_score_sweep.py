"""Many runs: every card belongs to its run."""

from __future__ import annotations

from pathlib import Path

from limo_sim.run.sweep import Run, play_all


def test_every_card_belongs_to_its_run_whatever_the_scenario_calls_itself(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('name = "another name"\n', encoding="utf-8")
    runs = [
        Run(str(file), "proxemic", "hog", 0, 0.2, 1.8),
        Run("workshop", "approach", "hog", 1, 0.4),
        Run("empty", "proxemic", "hog", 2, 0.1),
    ]
    cards = dict(play_all(runs, 1))
    assert set(cards) == set(runs)
    assert [cards[run].scenario for run in runs] == ["another name", "workshop", "empty"]
    assert [cards[run].target_m for run in runs] == [1.8, None, 1.5]
    assert [cards[run].seed for run in runs] == [0, 1, 2]
