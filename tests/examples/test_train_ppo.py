"""The example that learns to follow writes a policy that drives."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from limo_sim.run.baselines import Policy
from limo_sim.run.last_seen import SIZE

pytest.importorskip("stable_baselines3", reason="needs stable-baselines3, which brings torch, several gigabytes")

EXAMPLE = Path(__file__).parents[2] / "examples" / "train_ppo.py"


@pytest.mark.slow
def test_what_was_learnt_is_a_policy_without_torch(tmp_path: Path) -> None:
    out = tmp_path / "policy.npz"
    command = [sys.executable, str(EXAMPLE), "--out", str(out), "--steps", "4096"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert "learnt from 4096 actions" in done.stdout
    policy = Policy(out)
    assert np.abs(policy.act(np.linspace(-1, 1, SIZE, dtype=np.float32))).max() > 0
