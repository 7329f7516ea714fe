"""Find the packages of `pip install gyriflow` that have no wheel for a system, without
installing any.

    pip install uv
    ./run python benchmarks/wheels.py

uv resolves the requirements of `pyproject.toml`, and what they need in turn, with the
wheels that the package index has for each system and version of Python. `measuring` are
the dependencies alone, `fold` those with the extra, whose markers are ignored. The last
line is one JSON object.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from tempfile import TemporaryDirectory

from common import ROOT, print_rows

PLATFORMS = {
    "Linux x86_64, glibc 2.35": "x86_64-manylinux_2_35",
    "Linux x86_64, glibc 2.34": "x86_64-manylinux_2_34",
    "Linux arm64, glibc 2.35": "aarch64-manylinux_2_35",
    "macOS 13, arm64": "aarch64-apple-darwin",
    "macOS 13, x86_64": "x86_64-apple-darwin",
    "Windows, x86_64": "x86_64-pc-windows-msvc",
}
PYTHONS = ("3.12", "3.13", "3.14")
SOURCE_ONLY = (
    "connection-pool",
)  # needed by Snakemake; the package index has no wheel
WITHOUT_WHEEL = re.compile(
    r"([\w.-]+)(?:[<>=!~][^ ]*)? ha(?:s|ve) no (?:usable )?wheels"
)


def build_pure_wheels(folder: Path) -> None:
    """Build wheels of the packages that have none; ValueError if one is not of Python
    alone."""
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        "--quiet",
        "--no-deps",
        "--wheel-dir",
        str(folder),
    ]
    subprocess.run([*command, *SOURCE_ONLY], check=True)
    for wheel in folder.glob("*.whl"):
        if not wheel.stem.endswith("-none-any"):
            raise ValueError(f"{wheel.name} is not for every system")


def find_missing(
    requirements: list[str], platform: str, python: str, wheels: Path
) -> list[str]:
    """Return the packages without a wheel that requirements need; wheels in a folder
    count as those of the index."""
    missing: list[str] = []
    excluded = wheels / "excluded.txt"
    command = [
        "uv",
        "pip",
        "compile",
        "-",
        "--quiet",
        "--only-binary",
        ":all:",
        "--find-links",
        str(wheels),
    ]
    command += [
        "--python-platform",
        platform,
        "--python-version",
        python,
        "--excludes",
        str(excluded),
    ]
    while True:
        excluded.write_text("\n".join(missing))
        outcome = subprocess.run(
            command,
            input="\n".join(requirements),
            capture_output=True,
            text=True,
            check=False,
        )
        if outcome.returncode == 0:
            return sorted(missing)
        names = WITHOUT_WHEEL.findall(outcome.stderr)
        if not names or names[0] in missing:
            raise RuntimeError(outcome.stderr)
        missing.append(names[0])


def main() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
        "project"
    ]
    measuring = project["dependencies"]
    fold = list(measuring)
    for requirement in project["optional-dependencies"]["fold"]:
        fold.append(requirement.partition(";")[0].strip())
    rows = []
    with TemporaryDirectory() as folder:
        wheels = Path(folder)
        build_pure_wheels(wheels)
        for system, platform in PLATFORMS.items():
            for python in PYTHONS:
                row = {"system": system, "Python": python}
                for name, requirements in (("measuring", measuring), ("fold", fold)):
                    missing = find_missing(requirements, platform, python, wheels)
                    row[f"missing_for_{name}"] = ", ".join(missing) or "none"
                rows.append(row)
                print(row, file=sys.stderr, flush=True)
    print_rows(rows, built_from_source=SOURCE_ONLY)


if __name__ == "__main__":
    main()
