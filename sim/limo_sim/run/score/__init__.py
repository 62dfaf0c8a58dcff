"""How well a robot followed: the card of a run, measured of its log or as it goes."""

from __future__ import annotations

from limo_sim.run.score.card import ScoreCard
from limo_sim.run.score.scorer import Scorer, score

__all__ = ["ScoreCard", "Scorer", "score"]
