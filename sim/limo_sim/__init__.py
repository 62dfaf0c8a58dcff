"""A 10 x 10 m arena with a walking person and a Limo robot."""

from limo_sim.run.arena import Arena
from limo_sim.run.episode import Episode, run_episode
from limo_sim.run.score import ScoreCard, score
from limo_sim.world.scenario import Scenario

__all__ = ["Arena", "Episode", "Scenario", "ScoreCard", "run_episode", "score"]
