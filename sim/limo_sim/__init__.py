"""A 10 x 10 m arena with a walking person and a Limo robot."""

from limo_sim.arena import Arena
from limo_sim.episode import Episode, run_episode
from limo_sim.scenario import Scenario
from limo_sim.score import ScoreCard, score

__all__ = ["Arena", "Episode", "Scenario", "ScoreCard", "run_episode", "score"]
