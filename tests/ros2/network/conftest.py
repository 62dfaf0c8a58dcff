"""A ROS domain for every worker."""

import os

import pytest


@pytest.fixture(autouse=True)
def own_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests that run at once must not hear each other."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + worker))
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
