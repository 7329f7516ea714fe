"""The licences that the packages of the environment state: PyPI packages with all they
need, and the libraries inside the wheel of the solver.

    ./run python docs/licences.py

prints two tables and, as its last line, a JSON object with the number of packages by
kind of licence and the number of libraries.
"""

import json
import re
from collections import Counter
from importlib import metadata
from pathlib import Path

ENVIRONMENT = Path(__file__).resolve().parents[1] / "envs"
SOLVER = "dolfinx-solver-real"
LIBRARY = re.compile(r"^=+\n(.+) — (.+)$", re.MULTILINE)
"""Heading of a library in the solver's THIRD-PARTY-NOTICES: its name and licence."""
KINDS = {
    "AGPL": r"AGPL|Affero",
    "LGPL": r"LGPL|Lesser|LESSER|CeCILL-C|CeCill-C",
    "GPL": r"GPL|GNU General",
    "MPL": r"MPL|Mozilla",
    "permissive": (
        r"MIT|BSD|Apache|PSF|Python Software|Expat|ISC|public.domain|Public"
        r" Domain|matplotlib"
    ),
}
"""Kinds of licences, of which the first that fits counts."""
TEXTS = {
    "GNU LESSER GENERAL PUBLIC LICENSE": "LGPL",
    "Mozilla Public License": "MPL-2.0",
    "MIT License": "MIT",
}
"""What a licence's own text begins with."""


def required(name: str, found: dict[str, metadata.Distribution]) -> None:
    """Add a distribution and those that it needs, extras aside, to `found`."""
    key = re.sub(r"[-_.]+", "-", name).lower()
    if key in found:
        return
    try:
        distribution = metadata.distribution(name)
    except metadata.PackageNotFoundError:  # for another Python or system
        return
    found[key] = distribution
    for requirement in distribution.requires or []:
        if "extra ==" not in requirement:
            required(re.match(r"[\w.-]+", requirement)[0], found)  # type: ignore[index]


def stated(distribution: metadata.Distribution) -> str:
    """Return the licence that a distribution states: as an expression, in a class, in a
    word, or by its text."""
    about = distribution.metadata
    classes = [
        name.split(" :: ")[-1]
        for name in about.get_all("Classifier") or []
        if name.startswith("License")
    ]
    text = about.get("License-Expression") or "; ".join(classes) or ""
    first = (about.get("License") or "").strip().split("\n")[0]
    if not text and first:
        text = next(
            (name for start, name in TEXTS.items() if first.startswith(start)),
            first[:60],
        )
    if not text:
        files = [
            file
            for file in distribution.files or []
            if re.search(r"(?i)licen[cs]e|copying", file.name)
        ]
        starts = [file.read_text(encoding="utf-8").strip() for file in files]
        text = "; ".join(
            name
            for start, name in TEXTS.items()
            if any(found.startswith(start) for found in starts)
        )
    return text or "not stated"


def vendored() -> list[tuple[str, str]]:
    """Return the libraries in the wheel of the solver, each with its licence."""
    for file in metadata.files(SOLVER) or []:
        if file.name == "THIRD-PARTY-NOTICES":
            return LIBRARY.findall(file.read_text(encoding="utf-8"))
    return []


def kind(licence: str) -> str:
    """Return the kind of a licence."""
    return next(
        (name for name, pattern in KINDS.items() if re.search(pattern, licence)),
        "other",
    )


def main() -> None:
    text = (ENVIRONMENT / "requirements.txt").read_text()
    direct = re.findall(r"^([\w.-]+)", text, re.MULTILINE)
    found: dict[str, metadata.Distribution] = {}
    for name in (*direct, "fenics-dolfinx", "petsc4py", "mpi4py"):
        required(name, found)
    python = [
        (found[name].name, found[name].version, stated(found[name]))
        for name in sorted(found)
    ]
    libraries = vendored()
    print("| Python package | version | licence as stated |\n| --- | --- | --- |")
    for row in python:
        print("| " + " | ".join(row) + " |")
    print(f"\n| library in {SOLVER} | licence as stated |\n| --- | --- |")
    for library in libraries:
        print("| " + " | ".join(library) + " |")
    counts = Counter(kind(licence) for _, _, licence in python)
    print(json.dumps({"python": dict(counts), "libraries": len(libraries)}))


if __name__ == "__main__":
    main()
