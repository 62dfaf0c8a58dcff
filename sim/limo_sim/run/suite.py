"""Suites: frozen scenarios in groups, so that figures of different people and years can be compared."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from limo_sim.run.provenance import fingerprint
from limo_sim.world.schema import ScenarioError, build, from_toml

_FOLDER = Path(__file__).parents[1] / "suites"


@dataclass(frozen=True, slots=True)
class Entry:
    """One scenario of a suite: its file's name, its group, and the SHA-256 of the file, as 64 hexadecimal digits."""

    name: str
    group: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Suite:
    """A frozen set of scenarios."""

    #: name, summary: what it is called, and what it is for
    name: str
    summary: str
    seconds: float  #: simulated time of every run [s]
    scenarios: tuple[Entry, ...]  #: in the order in which they are shown, those of a group together

    @property
    def groups(self) -> dict[str, str]:
        """The group of each scenario."""
        return {entry.name: entry.group for entry in self.scenarios}

    def path(self, entry: Entry) -> Path:
        """Return the file of a scenario."""
        return _FOLDER / self.name / f"{entry.name}.toml"

    @staticmethod
    def names() -> tuple[str, ...]:
        """Names of the suites that come with limo-sim."""
        return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))

    @staticmethod
    def load(name: str) -> Suite:
        """Read a suite, and check that its files are those that were frozen.

        Raises `ScenarioError` where there is no such suite, or one of its files is another than when it was frozen.
        """
        if name not in Suite.names():
            raise ScenarioError(f"unknown suite {name}: want one of {', '.join(Suite.names())}")
        table = from_toml((_FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
        suite = build(Suite, {"name": name, **table}, f"suite {name}: ")
        for entry in suite.scenarios:
            found = fingerprint(suite.path(entry).read_bytes())
            if found != entry.sha256:
                raise ScenarioError(
                    f"suite {name}: {entry.name}.toml has the SHA-256 {found[:16]}…, want {entry.sha256[:16]}…: its "
                    "figures would be those of another suite; restore the file, or give a copy by --scenario"
                )
        return suite
