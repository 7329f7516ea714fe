"""Location of the data and the workflow that come with the package, in a checkout or installed."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
INSTALLED = PACKAGE / "shipped"
"""In an installed package, the folder with what a checkout has next to `src`."""
SHIPPED = INSTALLED if INSTALLED.is_dir() else PACKAGE.parents[1]
"""The folder with the Snakefile, `workflow`, `atlases`, `schemes`, `norms`, `config` and `profiles`."""
DEMO = SHIPPED / "config" / "config.yaml"
CONFIG = "gyriflow.yaml"
"""Name of the default configuration."""
