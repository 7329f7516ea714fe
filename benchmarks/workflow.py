"""Call the workflow for a configuration made by a script."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from gyriflow.errors import GyriflowError
from gyriflow.io.yaml_files import write_yaml

ROOT = Path(__file__).resolve().parents[1]


def call(folder: Path, config: dict[str, Any], cores: int, *targets: str) -> None:
    """Run targets in a folder; GyriflowError if one fails."""
    write_yaml(folder / "study.yaml", config)
    command = [sys.executable, "-m", "gyriflow.running.launch", "--cores", str(cores), *targets, "--snakefile"]
    command += [str(ROOT / "Snakefile"), "--configfile", str(folder / "study.yaml"), "--directory", str(folder)]
    path = os.pathsep.join(filter(None, [str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]))
    environment = os.environ | {"PYTHONPATH": path}
    outcome = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if outcome.returncode:
        raise GyriflowError(f"{targets[0]} failed", path=folder, found="\n".join(outcome.stderr.splitlines()[-15:]))
