"""Learn to follow a person from where the person was last seen: PPO on `LimoFollow-v1`, without images.

    pip install 'limo-hog[sim,cv]' stable-baselines3
    python examples/train_ppo.py --out mine.npz
    limo-hog score --scenario followable --controller policy:mine.npz approach --against approach

The weights go into a plain .npz file: driving with them needs numpy alone.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env

from limo_hog.atomic import whole_file

#: Scenarios to learn in: one person, slow and fast, in view at first or not.
SCENARIOS = ("followable", "standing", "sharp_turns", "late")


def environment() -> gymnasium.Env[Any, Any]:
    """Return one arena, which draws a scenario at every reset."""
    return gymnasium.make("limo_sim.env:LimoFollow-v1", scenario=SCENARIOS, observe="state")


def main() -> None:
    """Train, and write the policy."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("ppo.npz"), help="where the weights go (ppo.npz)")
    parser.add_argument("--steps", type=int, default=300_000, help="actions to learn from (300000)")
    parser.add_argument("--seed", type=int, default=0, help="of everything random (0)")
    args = parser.parse_args()
    # The networks are small: more threads would wait for each other.
    torch.set_num_threads(1)
    began = time.monotonic()
    # In one process: an arena takes less time for an action than a message to another process.
    arenas = make_vec_env(environment, n_envs=16, seed=args.seed)
    model = PPO(
        "MlpPolicy",
        arenas,
        n_steps=256,
        batch_size=512,
        n_epochs=10,
        gamma=0.97,
        learning_rate=5e-4,
        policy_kwargs={"log_std_init": -0.7},
        seed=args.seed,
        device="cpu",
        verbose=1,
    )
    model.learn(args.steps)
    layers = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    arrays = {}
    for index, layer in enumerate(layer for layer in layers if hasattr(layer, "weight")):
        arrays[f"w{index}"] = layer.weight.detach().numpy().T.astype(np.float32)
        arrays[f"b{index}"] = layer.bias.detach().numpy().astype(np.float32)
    with whole_file(args.out) as part:
        np.savez(part, **arrays)
    took = f"{time.monotonic() - began:.0f} s, {time.process_time():.0f} s of CPU time"
    print(f"{args.out}: learnt from {model.num_timesteps} actions in {took}")


if __name__ == "__main__":
    main()
