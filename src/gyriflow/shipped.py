"""Where the data and the workflow that come with the package lie: in a checkout, or installed."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
INSTALLED = PACKAGE / "shipped"
"""The folder in a wheel that holds what stands beside `src` in a checkout."""
SHIPPED = INSTALLED if INSTALLED.is_dir() else PACKAGE.parents[1]
"""The folder with the Snakefile, `workflow`, `atlases`, `schemes`, `norms`, `config` and `profiles`."""
DEMO = SHIPPED / "config" / "config.yaml"
CONFIG = "gyriflow.yaml"
"""Name of the configuration that is taken where none is named."""
