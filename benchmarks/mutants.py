"""Do the fast tests find one-line mistakes? Each mutant is put into a copy of the checkout, and its tests are run.

    ./run python benchmarks/mutants.py [--only figures.py]

A mutant is killed if its tests fail and survives if they pass. Two things are checked first: each text to be replaced
occurs exactly once in its file, and the tests pass without a mutant. The last line is one JSON object.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
SOURCE, TESTS = "src/gyriflow/", "tests/unit/"
NOT_COPIED = shutil.ignore_patterns(".git", "results", ".snakemake", "__pycache__", ".*_cache")
PASSED, FAILED = 0, 1
"""Exit codes of pytest; others mean that it could not run the tests."""


class Mutant(NamedTuple):
    """A file, a text in it that is replaced by a new one, and the file of tests that should then fail."""

    file: str
    old: str
    new: str
    tests: str


BY_TESTS = {
    # which brain, side or setting is selected
    "study/test_which_brain.py": [
        ("study/study.py", "max(before, key", "min(before, key"),
        ("study/study.py", "return min(given, key", "return max(given, key"),
        ("study/records.py", " and one.sides == self.sides", ""),
        ("study/series.py", "all(brain.sides == start.sides for brain in brains)", "True"),
        ("study/figures.py", "MOST_SERIES = 5, 4", "MOST_SERIES = 9, 4"),
    ],
    "study/test_study.py": [("study/resolve.py", "first = max(", "first = min(")],
    "study/test_growth_series.py": [("study/study.py", "late - early < 0.5", "late - early < 5")],
    "study/test_studies.py": [("study/checks.py", '"logs", ', "")],
    "study/test_participants.py": [("study/participants.py", "whole[3]) / 7", "whole[3]) / 10")],
    "study/test_maps_and_growth.py": [
        (
            "study/loading.py",
            '_merge(folding, PRESETS.get(str(run["preset"]), {}))',
            '_merge(PRESETS.get(str(run["preset"]), {}), folding)',
        ),
    ],
    # comparison and metrics
    "compare/test_placement.py": [
        ("compare/placement.py", "SKILLED_FROM = 1.5", "SKILLED_FROM = 0.5"),
        ("compare/prediction.py", '["run", "target"]', '["run"]'),
        ("compare/prediction.py", "SMOOTHING_MM = 3.0", "SMOOTHING_MM = 0.0"),
        ("compare/validation.py", 'row[name] / row[f"real_{name}"] - 1', '1 - row[name] / row[f"real_{name}"]'),
    ],
    "compare/test_calibration.py": [
        ("compare/calibration.py", "2 * finished.max() - finished.min()", "finished.max()")
    ],
    "metrics/test_norms.py": [("metrics/tables.py", " / (to_week - from_week)", "")],
    "metrics/test_gyrification.py": [("metrics/gyrification.py", "RADIUS_MM = 10.0", "RADIUS_MM = 15.0")],
    "metrics/test_measure.py": [("metrics/regions.py", '"curvedness": "1/mm"', '"curvedness": "1"')],
    # figures and pages
    "report/test_quality.py": [("report/quality.py", 'else "LR"', 'else "RL"')],
    "report/test_pictures.py": [
        ("report/scene.py", '"top", (0, 0, 1), (0, 1, 0), ("L", "R")', '"top", (0, 0, 1), (0, 1, 0), ("R", "L")'),
        ("report/scene.py", '"left", (-1, 0, 0), (0, 0, 1), ("A", "P")', '"left", (-1, 0, 0), (0, 0, 1), ("P", "A")'),
    ],
    "report/test_page.py": [
        ("report/page.py", "DEEP_MM = 0.5", "DEEP_MM = 5"),
        ("report/page.py", '"area_difference", "+.1f", 100', '"area_difference", "+.1f", 1'),
        ("settings/terms.py", "{1: 2.0, 2: 0.8}", "{1: 1.0, 2: 0.8}"),
    ],
    "report/test_tables.py": [("settings/terms.py", "CORE_POWER_W = 12.0", "CORE_POWER_W = 120.0")],
    "io/test_exports.py": [
        ("io/exports.py", '"sulc", "mm"', '"sulc", "1"'),
        ("io/exports.py", "_hemi-{side[0].upper()}{desc}_{kind}", "_hemi-L{desc}_{kind}"),
    ],
    # simulation, jobs and exit codes
    "folding/test_stress.py": [("folding/stress.py", "exp(-step_gw / memory_gw)", "exp(-memory_gw / step_gw)")],
    "cli/test_checking.py": [("running/cost.py", '"tetgen": 2.2', '"tetgen": 22')],
    "running/test_jobs.py": [("running/jobs.py", "st_mtime < since_s", "st_mtime > since_s")],
    "io/test_files.py": [("errors.py", "exit_code = 5", "exit_code = 1")],
}
MUTANTS = [
    Mutant(SOURCE + file, old, new, TESTS + tests) for tests, rows in BY_TESTS.items() for file, old, new in rows
]


def mutated(mutant: Mutant, folder: Path = ROOT) -> str:
    """Return the text of a mutant's file with the mistake; ValueError unless the old text occurs exactly once."""
    text = (folder / mutant.file).read_text()
    if (count := text.count(mutant.old)) != 1:
        raise ValueError(f"{mutant.file}: {mutant.old!r} occurs {count} times, expected once: update {__file__}")
    return text.replace(mutant.old, mutant.new)


def run_tests(folder: Path, *tests: str) -> int:
    """Run files of tests on a copy of the checkout up to the first failure, and return the exit code of pytest."""
    command = [sys.executable, "-B", "-m", "pytest", "-q", "-x", "-n", "0", "-m", "not slow", "-p", "no:cacheprovider"]
    environment = os.environ | {"PYTHONPATH": str(folder / "src")}
    outcome = subprocess.run(
        [*command, *tests], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if outcome.returncode not in (PASSED, FAILED):
        raise RuntimeError(f"{', '.join(tests)} could not be run:\n{outcome.stdout[-2000:]}{outcome.stderr[-2000:]}")
    return outcome.returncode


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="text in the file or the tests of the mutants that are tried")
    only, began = parser.parse_args().only, time.monotonic()
    mutants = [mutant for mutant in MUTANTS if only in f"{mutant.file} {mutant.tests}"]
    texts = [mutated(mutant) for mutant in mutants]
    survivors = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as temporary:
        folder = Path(temporary) / "gyriflow"
        shutil.copytree(ROOT, folder, ignore=NOT_COPIED)
        if run_tests(folder, *dict.fromkeys(mutant.tests for mutant in mutants)) != PASSED:
            raise RuntimeError("tests fail without any mutant")
        for mutant, text in zip(mutants, texts, strict=True):
            path = folder / mutant.file
            original = path.read_text()
            path.write_text(text)
            killed = run_tests(folder, mutant.tests) == FAILED
            path.write_text(original)
            survivors += [] if killed else [mutant._asdict()]
            print(f"{'killed' if killed else 'SURVIVED'}: {mutant.file}: {mutant.old} -> {mutant.new}", flush=True)
    counts = {"mutants": len(mutants), "killed": len(mutants) - len(survivors)}
    print(json.dumps(counts | {"survivors": survivors, "seconds": round(time.monotonic() - began)}))
    sys.exit(bool(survivors))


if __name__ == "__main__":
    main()
