"""Where the workflow, atlases, norms and configurations lie that come with the package: in a checkout or installed."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
INSTALLED = PACKAGE / "shipped"
"""The folder in a wheel that holds what stands beside `src` in a checkout."""
SHIPPED = INSTALLED if INSTALLED.is_dir() else PACKAGE.parents[1]
"""The folder with the Snakefile, `workflow`, `atlases`, `norms`, `config` and `profiles`."""
