"""Location of the data and the workflow that come with the package, in a checkout or
installed."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
INSTALLED = PACKAGE / "shipped"
"""In an installed package, the folder with what a checkout has next to `src`."""
SHIPPED = INSTALLED if INSTALLED.is_dir() else PACKAGE.parents[1]
"""The folder with the Snakefile, `workflow`, `atlases`, `schemes`, `norms`, `config`
and `profiles`."""
DEMO = SHIPPED / "config" / "config.yaml"
ATLASES = SHIPPED / "atlases"
"""Folder of the atlases that come with gyriflow, each in a folder of its own."""
CONFIG = "gyriflow.yaml"
"""Name of the default configuration."""


def shipped_atlases() -> list[str]:
    """Return the names of the atlases that come with gyriflow."""
    return sorted(path.parent.name for path in ATLASES.glob("*/atlas.yaml"))
