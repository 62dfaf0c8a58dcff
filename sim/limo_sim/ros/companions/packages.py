"""`ament_index_python`: a package's files lie around the script, where nothing is installed."""

from __future__ import annotations

from limo_sim.ros.rclpy_stub.context import default_context


def share_directory(package_name: str) -> str:
    """Return the package's folder around the script; the script's own folder where none has that name."""
    here = default_context().world.script.resolve().parent
    for folder in (here, *here.parents[:3]):
        for candidate in (folder, folder / package_name, folder / "src" / package_name):
            # (The Python package in a package has its name, too.)
            if candidate.name == package_name and candidate.is_dir() and not (candidate / "__init__.py").exists():
                return str(candidate)
    return str(here)
