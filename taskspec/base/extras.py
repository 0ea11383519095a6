"""Optional packages, and names that are imported on first use."""

from __future__ import annotations

import importlib
import importlib.util
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from taskspec.base.diagnostics import SpecError, spec_error

# Optional packages: imported when they are first needed, with the command that installs what is missing.

DISTRIBUTION = "taskspec-rl"
"""The name of this package for `pip`; on the public index, `taskspec` is another project."""


def need(module: str, extra: str = "", what: str = "this") -> Any:
    """Import a module of an optional package.

    Args:
        module: the full name, such as `matplotlib.figure`.
        extra: the extra of taskspec that installs the package; "" if there is none.
        what: the subject of the message.

    Raises:
        SpecError: E705 when it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise missing(package, install(extra) if extra else install_package(package), what) from error


def missing(package: str, hint: str, what: str = "this") -> SpecError:
    """Return the error E705: something needs a package that is not installed."""
    return spec_error("E705", f"{what} needs `{package}`, which is not installed", hint)


def is_installed(module: str) -> bool:
    """Return whether an optional package can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None


def install(extra: str) -> str:
    """Return a command that installs an extra of this package from where the package itself was installed.

    In a checkout that is its folder. Otherwise `direct_url.json` of the distribution says: a folder, a wheel, an address; a
    package of an index has no such file. Where the folder or wheel is gone, the packages of the extra are named one by one.
    """
    from importlib import metadata
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    checkout = Path(__file__).resolve().parents[2]
    project = checkout / "pyproject.toml"
    if project.is_file() and f'name = "{DISTRIBUTION}"' in project.read_text(encoding="utf-8"):
        root = str(checkout)
        if Path.cwd() == checkout:
            root = "."
        return f'pip install -e "{root}[{extra}]"'
    try:
        distribution = metadata.distribution(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return install_package(f"{DISTRIBUTION}[{extra}]")
    origin = json.loads(distribution.read_text("direct_url.json") or "{}")
    url = urlsplit(origin.get("url", ""))
    if url.scheme == "file":
        source = Path(url2pathname(url.path))
        if source.exists():
            return install_package(f"{source}[{extra}]")
        asked = [each for each in distribution.requires or () if each.endswith(f"extra == '{extra}'")]
        return install_package(*(each.partition(";")[0].strip() for each in asked))
    if "vcs_info" in origin:
        version = origin["vcs_info"]
        return install_package(f"{DISTRIBUTION}[{extra}] @ {version['vcs']}+{origin['url']}@{version['commit_id']}")
    if url.scheme:
        return install_package(f"{DISTRIBUTION}[{extra}] @ {origin['url']}")
    return install_package(f"{DISTRIBUTION}[{extra}]")


def install_package(*requirements: str) -> str:
    """Return the command that installs packages; all shells, also those of Windows, accept double quotes."""
    return " ".join(["pip install", *(f'"{each}"' for each in requirements)])


# Public names of packages that are imported on first use.


def on_demand(package: str, places: Mapping[str, str]) -> Callable[[str], object]:
    """Return the `__getattr__` of a package whose names are in other modules.

    Args:
        places: the module that each name is in, or is.
    """

    def find(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module '{package}' has no attribute {name!r}")
        value: object = importlib.import_module(places[name])
        if places[name] != f"{package}.{name}":
            value = getattr(value, name)
        setattr(sys.modules[package], name, value)
        return value

    return find
