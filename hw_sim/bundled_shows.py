"""Where a show's bundle is: in the folder that is given, or by its name inside the box's package."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from hw_sim.peers import ProbeError


def show_folder(given: Path | None) -> Path:
    """The folder of a show that is given by path or name; of the default without either.

    The box's package is found without importing any of it. Raises ProbeError where it is not installed.
    """
    if given is not None and (given / "show.yaml").is_file():
        return given
    package = find_spec("appliance")
    if package is None or not package.submodule_search_locations:
        raise ProbeError("The box's package `appliance` is not installed.")
    shows = Path(package.submodule_search_locations[0]) / "show"
    bundled = shows / f"{given or 'default'}_show"
    return bundled if given is None or bundled.is_dir() else given
