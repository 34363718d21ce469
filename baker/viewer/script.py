"""Finds three.js on this machine, so that the page works without a network.

The package `jupyter-threejs-sage`, a dependency, contains three.js as one file. A copy that npm installed can
be used instead. The file is either an ES module or a script that sets the global `THREE`.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from baker.core.errors import InputError, ResourceError

# Paths of three.js relative to a given folder, in order of preference. The folder may be npm's package,
# contain `node_modules`, or contain a single file.
_PATHS = (
    "build/three.module.min.js",
    "build/three.module.js",
    "node_modules/three/build/three.module.min.js",
    "node_modules/three/build/three.module.js",
    "three.module.min.js",
    "three.module.js",
    "build/three.min.js",
    "three.min.js",
)
_HELP = "`pip install jupyter-threejs-sage`, or `npm install three` and name its folder with `three=PATH`"


@dataclass(frozen=True)
class ThreeScript:
    """A copy of three.js.

    Attributes
    ----------
    path : Path
        The file that the page loads.
    module : bool
        True for an ES module, False for a script that sets the global `THREE`.
    """

    path: Path
    module: bool

    @property
    def files(self) -> dict[str, Path]:
        """Return the files that the page may request, by name.

        For a module, these are all .js files in its folder, because the module may import them.
        """
        if not self.module:
            return {self.path.name: self.path}
        return {path.name: path for path in sorted(self.path.parent.glob("*.js"))}


def find_three(location: Path | None) -> ThreeScript:
    """Return the copy of three.js at `location`, or the copy in the installed package.

    Parameters
    ----------
    location : Path or None
        The file of three.js, or a folder with it, see `_PATHS`; None for the installed Python package.

    Returns
    -------
    ThreeScript
        The file that the page loads, and whether it is a module.

    Raises
    ------
    InputError
        If there is no three.js at `location`.
    ResourceError
        If `location` is None and the package is not installed.
    """
    if location is not None:
        return _named(location)
    package = find_spec("jupyter_threejs_sage")
    for folder in (package.submodule_search_locations or ()) if package is not None else ():
        # The package has a folder for each release (r122, r130 ...): use the newest.
        found = sorted(
            Path(folder).glob("static/r*/three.min.js"), key=lambda path: int(path.parent.name[1:])
        )
        if found:
            return ThreeScript(found[-1], module=False)
    raise ResourceError(f"three.js is not installed, which the page is drawn with; {_HELP}")


def _named(location: Path) -> ThreeScript:
    tried = [location] if location.is_file() else [location / name for name in _PATHS]
    for path in tried:
        if path.is_file() and path.suffix in (".js", ".mjs"):
            return ThreeScript(path.resolve(), module=path.suffix == ".mjs" or ".module." in path.name)
    message = "there is no three.js here; name its file (three.module.min.js) or the folder where npm put it"
    raise InputError(message, file=str(location))
