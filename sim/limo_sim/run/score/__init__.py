"""How well a robot followed: the card of a run, measured as it goes."""

from __future__ import annotations

from limo_sim.run.score.card import ScoreCard
from limo_sim.run.score.scorer import Episode, Scorer

__all__ = ["Episode", "ScoreCard", "Scorer"]
