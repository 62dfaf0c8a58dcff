"""A seeded sample of mutants of the Rust crate: all are compiled at once, and a variable chooses one for the tests.

`python -m tests.hardening.rust_mutants --count 440 --state FILE` prints those that no test of the crate notices. The
copy of the crate that holds them lies in target/mutants; FILE keeps what was decided, and a later run goes on.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import resource
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
CRATE, BUILD = ROOT / "crates/hog_core", ROOT / "target/mutants"
#: What is changed: the search, the exact path, the kernels and the grouping.
FILES = (
    *("detect.rs", "describe.rs", "guided.rs", "rescore.rs", "params.rs", "image.rs"),
    *("group/candidate.rs", "group/mean_shift.rs", "group/similar.rs"),
    *("pyramid/grid.rs", "pyramid/levels.rs", "pyramid/resize.rs"),
    *(f"exact/{name}.rs" for name in ("blocks", "gradient", "polar", "svm", "tables", "windows")),
    *(f"separable/{name}.rs" for name in ("lattice", "mod", "plan")),
    *(f"fast/{name}.rs" for name in ("describe", "plan", "rows", "score", "search", "strip", "tile", "votes")),
)
#: Test programs, those that tell soonest first: name, arguments, cases of random tests. One test takes half the time.
PYRAMIDS = "pyramids_are"
TESTS: list[tuple[str, list[str], int]] = [
    ("hog_core", [], 8),
    ("opencv", [], 8),
    ("calls", [], 8),
    ("threads", [], 8),
    ("backends", ["--skip", PYRAMIDS], 8),
    ("backends", [PYRAMIDS], 2),
]
#: A mutant under which a test program takes this much more processor time than without one hangs [times, s].
LATEST = 3.0, 3.0
#: Memory of a test program [bytes].
MEMORY = 8_000_000_000
MANIFEST = """[workspace]
members = ["hog_core"]
resolver = "3"
[workspace.package]
version = "0.0.0"
edition = "2024"
rust-version = "1.89"
license = "MIT"
repository = ""
[workspace.lints.rust]
[profile.test]
opt-level = 2
codegen-units = 16
debug = 0
"""


@dataclass(frozen=True)
class Run:
    """Some tests of a program, and how many cases a random test has."""

    program: Path
    arguments: tuple[str, ...]
    cases: int


def tool(*arguments: str | Path, said: str = "") -> str:
    """Run the program in mutants/ for the files; return its output."""
    program = BUILD / "tool/debug/hog_core-mutants"
    done = subprocess.run(
        [str(part) for part in (program, *arguments, *FILES)], check=True, stdout=subprocess.PIPE, input=said, text=True
    )
    return done.stdout


def mutants() -> dict[int, str]:
    """Return every mutant's number and what it changes."""
    build = ["cargo", "build", "--quiet", "--manifest-path", "mutants/Cargo.toml", "--target-dir", str(BUILD / "tool")]
    subprocess.run(build, cwd=ROOT, check=True)
    listed = (line.split("\t", 1) for line in tool("list", CRATE).splitlines())
    return {int(number): what for number, what in listed}


def built(sample: list[int]) -> tuple[Path, list[Run]]:
    """Write and compile the crate with these mutants; return its folder, and the tests."""
    copy = BUILD / "crate"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(CRATE, copy / "hog_core")
    (copy / "Cargo.toml").write_text(MANIFEST)
    # The benchmarks and what they need are left out.
    manifest = copy / "hog_core/Cargo.toml"
    lines = manifest.read_text().split("[[bench]]")[0].splitlines()
    manifest.write_text("\n".join(line for line in lines if not line.startswith("criterion")))
    shutil.copy(ROOT / "Cargo.lock", copy)
    tool("write", CRATE, copy / "hog_core", said=" ".join(map(str, sample)))
    cargo = [
        "cargo",
        "test",
        "--no-run",
        "--message-format=json",
        "--lib",
        "--tests",
        "--target-dir",
        str(BUILD / "target"),
    ]
    said = subprocess.run(cargo, cwd=copy, check=True, stdout=subprocess.PIPE, text=True).stdout
    programs = {}
    for line in said.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["profile"]["test"]:
            programs[message["target"]["name"]] = Path(message["executable"])
    return copy / "hog_core", [Run(programs[name], tuple(arguments), cases) for name, arguments, cases in TESTS]


def passes(run: Run, folder: Path, number: int, seconds: int) -> tuple[bool, float]:
    """Run tests with a mutant, 0 is none; return whether all pass, and their processor time [s]."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    chosen = {"MUTANT": str(number), "PROPTEST_CASES": str(run.cases), "PROPTEST_FAILURE_PERSISTENCE": "off"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with subprocess.Popen(
        [run.program, "--test-threads=1", *run.arguments],
        cwd=folder,
        env=os.environ | chosen | {"RUST_BACKTRACE": "0"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        preexec_fn=limited,
    ) as process:
        assert process.stdout
        # The first failure is enough.
        if any(b"FAILED" in line for line in process.stdout):
            process.kill()
    return process.returncode == 0, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def noticed(number: int, runs: dict[Run, int], folder: Path) -> bool:
    """Whether a test fails, or does not end in its time [s], with this mutant."""
    return not all(passes(run, folder, number, seconds)[0] for run, seconds in runs.items())


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=440)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--state", type=Path, help="where it is kept which were noticed")
    args = parser.parse_args()
    every = mutants()
    sample = random.Random(args.seed).sample(list(every), min(args.count, len(every)))
    folder, runs = built(sample)
    limits: dict[Run, int] = {}
    for run in runs:
        passed, took = passes(run, folder, 0, 3600)
        if not passed:
            print(f"{run.program.name}: the tests fail without a mutant")
            return 2
        limits[run] = math.ceil(LATEST[0] * took + LATEST[1])
    print("without a mutant the tests pass", flush=True)
    state: dict[str, bool] = {}
    if args.state and args.state.exists():
        state = json.loads(args.state.read_text())
    for number in sample:
        key = f"{number} {every[number]}"
        if key not in state:
            state[key] = noticed(number, limits, folder)
            if args.state:
                args.state.write_text(json.dumps(state, indent=1))
    decided = {number: state[f"{number} {every[number]}"] for number in sample}
    caught = sum(decided.values())
    print(f"{caught} of {len(sample)} noticed ({caught / max(len(sample), 1):.1%}) of {len(every)} there are")
    for number in sorted(sample):
        if not decided[number]:
            print(f"  {number} {every[number]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
