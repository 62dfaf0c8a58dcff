"""Measures how many actions a second `LimoFollow-v1` takes on one core, for every kind of observation.

Run on a quiet machine: `uv run python benches/environment.py`.
"""

from __future__ import annotations

import time

import cv2
import gymnasium
import numpy as np

import limo_hog
from limo_sim.env import KINDS

ACTIONS, TRIES = 200, 5


def main() -> None:
    """Prints the best of several tries, in actions a second of this process's CPU time."""
    limo_hog.set_num_threads(1)
    cv2.setNumThreads(1)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (ACTIONS, 2)).astype(np.float32)
    envs = {kind: gymnasium.make("limo_sim.env:LimoFollow-v1", observe=kind) for kind in KINDS}
    best = dict.fromkeys(envs, 0.0)
    for seed in range(TRIES):
        for name, env in envs.items():
            env.reset(seed=seed)
            began = time.process_time()
            for action in actions:
                env.step(action)
            best[name] = max(best[name], ACTIONS / (time.process_time() - began))
    for name, rate in best.items():
        print(f"{name}: {rate:.0f} actions a second")


if __name__ == "__main__":
    main()
