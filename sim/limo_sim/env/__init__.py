"""The arena for Gymnasium: `gymnasium.make("limo_sim.env:LimoFollow-v1")` imports this module, which registers it."""

import gymnasium

from limo_sim.env.first import LimoFollow, reward_parts
from limo_sim.env.second import LimoFollowV1

__all__ = ["LimoFollow", "LimoFollowV1", "reward_parts"]

gymnasium.register("LimoFollow-v0", entry_point="limo_sim.env:LimoFollow", max_episode_steps=600)
gymnasium.register("LimoFollow-v1", entry_point="limo_sim.env:LimoFollowV1", max_episode_steps=600)
