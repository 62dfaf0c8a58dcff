"""Writes benches/RESULTS.md: every backend of this machine against OpenCV, as `limo-hog bench` measures it.

Run on a quiet machine: `uv run python benches/compare.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from limo_hog import _core

RESULTS = Path(__file__).with_name("RESULTS.md")


def measure(backend: str) -> dict[str, Any]:
    """The bench's JSON with `backend` in force."""
    command = [sys.executable, "-m", "limo_hog.cli.main", "bench", "--json", "-", "--threads", "1", "2"]
    environment = {**os.environ, "LIMO_HOG_BACKEND": backend}
    found = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    result: dict[str, Any] = json.loads(found.stdout)
    return result


def table(rows: list[dict[str, Any]]) -> list[str]:
    """One markdown line per measurement."""
    lines = ["| frame | threads | backend | limo-hog ms (median) | cv2 ms (median) | times faster | equal |"]
    lines.append("|---|---|---|---|---|---|---|")
    for row in rows:
        width, height = row["size"]
        colour = "gray" if row["channels"] == 1 else "BGR"
        limo, cv2 = row["limo_ms"], row["cv2_ms"]
        rival = f"{cv2['min']:.1f} ({cv2['p50']:.1f})" if cv2 else "-"
        ratio = f"{row['ratio']:.1f}" if row["ratio"] else "-"
        lines.append(
            f"| {width}×{height} {colour} | {row['threads']} | {row['backend']} "
            f"| {limo['min']:.2f} ({limo['p50']:.2f}) | {rival} | {ratio} | {row['rects_equal']} |"
        )
    return lines


def main() -> None:
    """Measures, then replaces the page."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    results = [measure(backend) for backend in _core.available_backends()]
    facts = results[0]["environment"]
    lines = [
        "# Against OpenCV",
        "",
        "Written by `benches/compare.py`; milliseconds are the least of many interleaved calls.",
        "",
    ]
    lines += [f"- {name}: {value}" for name, value in facts.items()]
    lines += ["", *table([row for result in results for row in result["rows"]])]
    draft = RESULTS.with_suffix(".tmp")
    draft.write_text("\n".join(lines) + "\n")
    draft.replace(RESULTS)


if __name__ == "__main__":
    main()
