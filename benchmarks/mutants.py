"""Check that the fast tests find one-line mistakes: put each mutant into a copy of the checkout and run its tests.

    ./run python benchmarks/mutants.py [--only figures.py]

A mutant is killed if its tests fail and survives if they pass. Two things are checked first: each text to replace
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
TESTS = "tests/unit/"
NOT_COPIED = shutil.ignore_patterns(".git", "results", ".snakemake", "__pycache__", ".*_cache")


class Mutant(NamedTuple):
    """A file, a text in it that is replaced by a new one, and the file of tests that should then fail."""

    file: str
    old: str
    new: str
    tests: str


BY_TESTS = {
    # which brain, side or setting is chosen
    "study/test_which_brain.py": [
        ("src/gyriflow/study/study.py", "max(earlier, key", "min(earlier, key"),
        ("src/gyriflow/study/study.py", "return min(sources, key", "return max(sources, key"),
        ("src/gyriflow/study/records.py", "brain.sides == self.sides", "True"),
        ("src/gyriflow/study/series.py", "all(brain.sides == start.sides for brain in brains)", "True"),
        ("src/gyriflow/settings/terms.py", "10 if individuals", "19 if individuals"),
    ],
    "study/test_study.py": [("src/gyriflow/study/resolve.py", "first = max(", "first = min(")],
    "study/test_growth_series.py": [("src/gyriflow/study/study.py", "late - early < 0.5", "late - early < 5")],
    "study/test_studies.py": [("src/gyriflow/study/checks.py", '"logs", ', "")],
    "study/test_participants.py": [("src/gyriflow/study/ages.py", "whole[4]) / 7", "whole[4]) / 10")],
    "study/test_maps_and_growth.py": [("src/gyriflow/study/loading.py", "{})), run)", "{})) | folding, run)")],
    # comparisons and metrics
    "compare/test_placement.py": [("src/gyriflow/compare/placement.py", "interval_of(room)[1] > 0", "room[0] > 0")],
    "compare/test_prediction.py": [("src/gyriflow/compare/prediction.py", '!= "run"]', '!= "target"]')],
    "compare/test_deviation.py": [
        ("src/gyriflow/compare/deviation.py", "SMOOTHING_MM = 3.0", "SMOOTHING_MM = 0.0"),
        ("src/gyriflow/compare/deviation.py", " * expected_mm / start_mm", ""),
    ],
    "compare/test_validation.py": [
        ("src/gyriflow/compare/validation.py", 'row[f"real_{name}"] - 1', '-row[f"real_{name}"] + 1'),
    ],
    "compare/test_calibration.py": [("src/gyriflow/compare/calibration.py", "- finished.min()", "- finished.max()")],
    "metrics/test_norms.py": [("src/gyriflow/metrics/tables.py", " / (to_week - from_week)", "")],
    "metrics/test_gyrification.py": [("src/gyriflow/metrics/gyrification.py", "RADIUS_MM = 10.0", "RADIUS_MM = 15.0")],
    "metrics/test_measure.py": [
        ("src/gyriflow/quantities.py", '"curvedness", "1/mm", "curvedness"', '"curvedness", "1", "curvedness"')
    ],
    # figures, pages and files
    "report/test_quality.py": [("src/gyriflow/report/quality.py", 'else "LR"', 'else "RL"')],
    "report/test_pictures.py": [
        ("src/gyriflow/report/scene.py", '(0, 1, 0), ("L", "R")', '(0, 1, 0), ("R", "L")'),
        ("src/gyriflow/report/scene.py", '("A", "P")),', '("P", "A")),'),
    ],
    "report/test_page.py": [
        ("src/gyriflow/report/page.py", "MAX_PENETRATION_MM = 0.5", "MAX_PENETRATION_MM = 5"),
        ("src/gyriflow/report/page.py", '"area_difference", "+.1f", 100', '"area_difference", "+.1f", 1'),
        ("src/gyriflow/settings/terms.py", "{1: 2.0, 2: 0.8}", "{1: 1.0, 2: 0.8}"),
    ],
    "report/test_tables.py": [
        ("src/gyriflow/report/tables.py", "costs.carbon_g_per_kwh / 1000", "costs.carbon_g_per_kwh")
    ],
    "report/test_report_scripts.py": [
        ("workflow/scripts/study_records.py", '"inputs": inputs[brain["id"]]', '"inputs": {}'),
        ("workflow/scripts/run_tables.py", 'settings["growth_of"] = grown', 'settings["growth_of"] = ""'),
    ],
    "io/test_exports.py": [
        ("src/gyriflow/quantities.py", '"sulcal_depth_mm", "mm"', '"sulcal_depth_mm", "1"'),
        ("src/gyriflow/io/exports.py", "_hemi-{side[0].upper()}{desc}_{kind}", "_hemi-L{desc}_{kind}"),
    ],
    # simulations, jobs and exit codes
    "folding/test_stress.py": [("src/gyriflow/folding/stress.py", "-step_gw / memory_gw", "-memory_gw / step_gw")],
    "cli/test_checking.py": [("src/gyriflow/running/cost.py", '"tetgen": 2.2', '"tetgen": 22')],
    "running/test_jobs.py": [("src/gyriflow/running/jobs.py", "st_mtime < since_s", "st_mtime > since_s")],
    "io/test_files.py": [("src/gyriflow/errors.py", "exit_code = 5", "exit_code = 1")],
}
MUTANTS = [Mutant(file, old, new, TESTS + tests) for tests, rows in BY_TESTS.items() for file, old, new in rows]


def mutated(mutant: Mutant) -> str:
    """Return the text of a mutant's file with the mistake; ValueError unless the old text occurs exactly once."""
    text = (ROOT / mutant.file).read_text()
    if (count := text.count(mutant.old)) != 1:
        raise ValueError(f"{mutant.file}: {mutant.old!r} occurs {count} times, expected once: update {__file__}")
    return text.replace(mutant.old, mutant.new)


def failure(folder: Path, *tests: str) -> str:
    """Return the last lines of files of tests in a checkout, up to the first that fails; "" if all pass."""
    options = ["-q", "-x", "-n", "0", "-m", "not slow", "-p", "no:cacheprovider"]
    command = [sys.executable, "-B", "-m", "pytest", *options, *tests]
    environment = os.environ | {"PYTHONPATH": str(folder / "src")}
    outcome = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    output = f"{outcome.stdout[-2000:]}{outcome.stderr[-2000:]}"
    # pytest ends with 1 for tests that fail, and for files of tests that cannot be imported
    if outcome.returncode not in (0, 1) or "ERROR collecting" in outcome.stdout:
        raise RuntimeError(f"{', '.join(tests)} could not be run:\n{output}")
    return output if outcome.returncode else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="text in the file or the tests of the mutants that are tried")
    only, began, survivors = parser.parse_args().only, time.monotonic(), []
    mutants = {mutant: mutated(mutant) for mutant in MUTANTS if only in f"{mutant.file} {mutant.tests}"}
    with tempfile.TemporaryDirectory(prefix="mutants-") as temporary:
        folder = Path(temporary) / "gyriflow"
        shutil.copytree(ROOT, folder, ignore=NOT_COPIED)
        if output := failure(folder, *dict.fromkeys(mutant.tests for mutant in mutants)):
            raise RuntimeError(f"tests fail without a mutant:\n{output}")
        for mutant, text in mutants.items():
            path = folder / mutant.file
            original = path.read_text()
            path.write_text(text)
            killed = bool(failure(folder, mutant.tests))
            path.write_text(original)
            survivors += [] if killed else [mutant]
            print(f"{'killed' if killed else 'SURVIVED'}: {mutant.file}: {mutant.old!r} -> {mutant.new!r}", flush=True)
    counts = {"mutants": len(mutants), "killed": len(mutants) - len(survivors)}
    print(json.dumps(counts | {"survived": survivors, "seconds": round(time.monotonic() - began)}))
    sys.exit(bool(survivors))


if __name__ == "__main__":
    main()
