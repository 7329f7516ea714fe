"""How long `gyriflow check` takes: `./run python benchmarks/check.py [CONFIG ...]`, by default of config/examples.

Times are processor seconds of the command and all that it starts, which other load changes little: with input files,
and without them (`--no-files`). Configurations whose inputs are not there are left out. A study of 50 runs comes last.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import yaml

EXAMPLES = Path(__file__).parents[1] / "config" / "examples"
FIFTY = {
    "atlas": {"name": "spina-bifida", "series": "unoperated", "weeks": [21, 22, 23]},
    "start": "first",
    "folding": {"end_week": 23},
    "runs": {f"run{number}": {"thickness_mm": 1 + 0.04 * number} for number in range(50)},
}


def check(config: Path, *options: str) -> tuple[float, str, int]:
    """Returns processor seconds of a check, what it printed, and its exit code."""
    with tempfile.TemporaryDirectory() as folder:
        before = os.times()
        done = subprocess.run(
            [sys.executable, "-m", "gyriflow.cli", "check", str(config), "-d", folder, *options],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        after = os.times()
    seconds = after.children_user + after.children_system - before.children_user - before.children_system
    return seconds, done.stdout + done.stderr, done.returncode


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("configs", nargs="*", type=Path, default=sorted(EXAMPLES.glob("*.yaml")))
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        fifty = Path(folder, "fifty-runs.yaml")
        fifty.write_text(yaml.safe_dump(FIFTY))
        for config in [*parser.parse_args().configs, fifty]:
            seconds, said, _ = check(config)
            steps = re.search(r"^to run: (\d+) steps$", said, flags=re.MULTILINE)
            if steps is None:
                print(f"{config.name}: left out: {said.strip().splitlines()[-1]}")
                continue
            found[config.stem] = {
                "steps": int(steps[1]),
                "cpu_seconds": round(seconds, 1),
                "without_files": round(check(config, "--no-files")[0], 1),
            }
            print(f"{config.name}: {found[config.stem]}", flush=True)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
