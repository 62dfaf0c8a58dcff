"""A seeded sample of mutants of the Rust crate: all are compiled at once, and a variable chooses one for the tests.

`python -m tests.hardening.rust_mutants exact --count 300 --state FILE` prints those that no test of the crate notices.
The copy of the crate that holds them lies in target/mutants; FILE keeps what was decided, and a later run goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
CRATE, BUILD = ROOT / "crates/hog_core", ROOT / "target/mutants"
#: What is changed, in two builds: the compiler takes long over the kernels, as each instruction set has its own.
FILES = {
    "exact": (
        *("detect.rs", "rescore.rs", "params.rs", "group/candidate.rs", "group/mean_shift.rs", "group/similar.rs"),
        *("pyramid/grid.rs", "pyramid/levels.rs", "pyramid/resize.rs", "exact/blocks.rs", "exact/gradient.rs"),
        *("exact/polar.rs", "exact/svm.rs", "exact/tables.rs", "exact/windows.rs", "fast/plan.rs"),
    ),
    "fast": ("fast/level.rs", "fast/rows.rs", "fast/score.rs", "fast/strip.rs"),
}
#: Test binaries, those that tell soonest first.
TESTS = ("hog_core", "opencv", "backends")
#: A mutant under which the tests take longer hangs [s].
LATEST_S = 240.0
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
opt-level = 1
debug = 0
"""


def built(part: str) -> tuple[dict[int, str], list[Path]]:
    """Write and compile the crate with the mutants of a part; return what they are, and the test programs."""
    subprocess.run(
        ["cargo", "build", "--quiet", "--manifest-path", "mutants/Cargo.toml", "--target-dir", BUILD / "tool"],
        cwd=ROOT,
        check=True,
    )
    copy = BUILD / part
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(CRATE, copy / "hog_core")
    (copy / "Cargo.toml").write_text(MANIFEST)
    # The benchmarks and what they need are left out.
    manifest = copy / "hog_core/Cargo.toml"
    lines = manifest.read_text().split("[[bench]]")[0].splitlines()
    manifest.write_text("\n".join(line for line in lines if not line.startswith("criterion")))
    shutil.copy(ROOT / "Cargo.lock", copy)
    told = subprocess.run(
        [str(path) for path in (BUILD / "tool/debug/hog_core-mutants", CRATE, copy / "hog_core", *FILES[part])],
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    mutants = dict(line.split("\t", 1) for line in told.splitlines())
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
    return {int(number): what for number, what in mutants.items()}, [programs[name] for name in TESTS]


def noticed(number: int, programs: list[Path], folder: Path) -> bool:
    """Whether a test fails, or does not end, with this mutant; 0 is none."""
    environment = os.environ | {"MUTANT": str(number), "PROPTEST_CASES": "8", "RUST_BACKTRACE": "0"}
    until = time.monotonic() + LATEST_S
    for program in programs:
        with subprocess.Popen(
            [program, "--test-threads=1"],
            cwd=folder,
            env=environment | {"PROPTEST_FAILURE_PERSISTENCE": "off"},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as run:
            assert run.stdout
            os.set_blocking(run.stdout.fileno(), False)
            said = ""
            while (code := run.poll()) is None and "FAILED" not in said and time.monotonic() < until:
                said += run.stdout.read() or ""
                time.sleep(0.02)
            if code is None:
                run.kill()
            if code != 0:
                return True
    return False


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("part", choices=list(FILES))
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--state", type=Path, help="where it is kept which were noticed")
    parser.add_argument("--only", help="mutants of files whose path begins so")
    args = parser.parse_args()
    mutants, programs = built(args.part)
    folder = BUILD / args.part / "hog_core"
    if noticed(0, programs, folder):
        print("the tests fail without a mutant")
        return 2
    state: dict[str, bool] = {}
    if args.state and args.state.exists():
        state = json.loads(args.state.read_text())
    every = [number for number, what in mutants.items() if not args.only or what.startswith(args.only)]
    sample = random.Random(args.seed).sample(every, min(args.count, len(every)))
    for number in sample:
        key = f"{number} {mutants[number]}"
        if key not in state:
            state[key] = noticed(number, programs, folder)
            if args.state:
                args.state.write_text(json.dumps(state, indent=1))
    decided = {number: state[f"{number} {mutants[number]}"] for number in sample}
    caught = sum(decided.values())
    print(f"{caught} of {len(sample)} noticed ({caught / max(len(sample), 1):.1%}) of {len(every)} there are")
    for number in sorted(sample):
        if not decided[number]:
            print(f"  {number} {mutants[number]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
