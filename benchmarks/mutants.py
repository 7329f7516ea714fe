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
    # places and volumes in long, turned voxels, at every border and on both sides
    "anatomy/test_labels.py": [
        ("src/gyriflow/anatomy/labels.py", "in (areas[:2], areas[:-3:-1])", "in (areas[:2],)"),
        ("src/gyriflow/anatomy/labels.py", '"inside_cortex": main & ~fluid & ~outer', '"inside_cortex": main & ~outer'),
    ],
    "anatomy/test_thickness.py": [
        ("src/gyriflow/anatomy/thickness.py", "np.abs(points[:, 0] - fissure_x_mm)", "(points[:, 0] - fissure_x_mm)"),
        (
            "src/gyriflow/anatomy/thickness.py",
            "points, size = pial.vertices, np.linalg.norm(affine[:3, :3], axis=0)",
            "points, size = pial.vertices, np.linalg.norm(affine[:3, :3], axis=1)",
        ),
    ],
    "anatomy/test_pial.py": [
        ("src/gyriflow/anatomy/pial.py", "motion(shift=-moved * to_right)", "motion(shift=moved * to_right)"),
    ],
    "anatomy/test_sulci.py": [
        ("src/gyriflow/anatomy/pial.py", 'report["opened_mL"] - gained_ml', 'report["opened_mL"]'),
        (
            "src/gyriflow/anatomy/sulci.py",
            "MIN_BANK_DISTANCE * thickness",
            "MIN_BANK_DISTANCE * np.median(thickness[cortex])",
        ),
    ],
    "anatomy/test_plausible.py": [
        ("src/gyriflow/anatomy/plausible.py", "max(before / after, after / before)", "before / after"),
    ],
    # which brain, side or setting is chosen
    "study/test_which_brain.py": [
        ("src/gyriflow/study/study.py", "max(earlier, key", "min(earlier, key"),
        ("src/gyriflow/study/study.py", "return min(sources, key", "return max(sources, key"),
        ("src/gyriflow/study/records.py", "brain.sides == self.sides", "True"),
        ("src/gyriflow/study/study.py", "return min(self.chains", "return max(self.chains"),
        ("src/gyriflow/study/study.py", "(other.labels is None, abs(", "(abs("),
        ("src/gyriflow/study/study.py", " and side in template.sides", ""),
        ("src/gyriflow/study/series.py", "if week <= end and week not in", "if week not in"),
        ("src/gyriflow/study/resolve.py", "if week < weeks[-1])", ")"),
        ("src/gyriflow/study/series.py", "all(brain.sides == start.sides for brain in brains)", "True"),
        ("src/gyriflow/settings/terms.py", "10 if individuals", "19 if individuals"),
    ],
    "study/test_study.py": [("src/gyriflow/study/series.py", "first = max(", "first = min(")],
    "study/test_growth_series.py": [("src/gyriflow/study/study.py", "late - early < 0.5", "late - early < 5")],
    "study/test_studies.py": [("src/gyriflow/study/checks.py", '"logs", ', "")],
    "study/test_participants.py": [("src/gyriflow/settings/weeks.py", "whole[4]) / 7", "whole[4]) / 10")],
    "study/test_maps_and_growth.py": [
        ("src/gyriflow/settings/runs.py", "if is_preset else base", "if False else base")
    ],
    # comparisons and metrics
    "compare/test_placement.py": [
        ("src/gyriflow/compare/placement.py", '"gain", r - r_start', '"gain", r - r_adjacent'),
        ("src/gyriflow/compare/placement.py", "max(size - 1, 1)", "size"),
        ("src/gyriflow/compare/placement.py", "np.sqrt(self.side_areas) * finer", "finer"),
        ("src/gyriflow/compare/placement.py", "asymmetry_mm < SYMMETRY_TOL_MM", "asymmetry_mm < 0"),
    ],
    "compare/test_prediction.py": [
        ("src/gyriflow/compare/comparison.py", 'if model != "run"]', 'if model != "target"]'),
        ("src/gyriflow/compare/comparison.py", "drawn[key] - atlas[key]", "drawn[key] - atlas[key][0]"),
        ("src/gyriflow/compare/comparison.py", "table[name] / curve - 1}", "curve / table[name] - 1}"),
        ("src/gyriflow/compare/comparison.py", 'week - labels["start_week"]', "week"),
    ],
    "compare/test_comparison.py": [
        ("src/gyriflow/compare/comparison.py", 'row[f"observed_{name}_{unit}"] - 1', "100"),
        (
            "src/gyriflow/compare/comparison.py",
            "float(crossing_faces(predicted))",
            "float(crossing_faces(prepared.mesh))",
        ),
        (
            "src/gyriflow/compare/comparison.py",
            "roughness_mm(prepared.mesh) / roughness_mm(observed.prepared.mesh)",
            "roughness_mm(observed.prepared.mesh) / roughness_mm(prepared.mesh)",
        ),
        (
            "src/gyriflow/compare/shapes.py",
            "surface.curvature_rms / observed.curvature_rms",
            "observed.curvature_rms / surface.curvature_rms",
        ),
        ("src/gyriflow/compare/comparison.py", "np.tile(on_left, 2)[", "np.arange(2 * len(on_left))["),
    ],
    "compare/test_accuracy.py": [
        ("src/gyriflow/compare/accuracy.py", "count / (count + 1)", "(count - 1) / count"),
        ("src/gyriflow/compare/accuracy.py", "np.maximum(shorter, shortest)", "shorter"),
        ("src/gyriflow/compare/accuracy.py", "(rank + 1) * LEVEL", "rank * LEVEL"),
        ("src/gyriflow/compare/accuracy.py", "abs(means.mean()) > error", "True"),
        ("src/gyriflow/compare/accuracy.py", "max(found.largest for found in smaller)", "smaller[-1].largest"),
        ("src/gyriflow/compare/accuracy.py", 'rows["start_week"] + rows["horizon"]', 'rows["horizon"]'),
        ("src/gyriflow/compare/accuracy.py", "<= ATLAS_MARGIN", "<= 0"),
        ("src/gyriflow/compare/accuracy.py", 'errors["start"] != start', 'errors["start"] != ""'),
    ],
    "compare/test_ensemble.py": [
        ("src/gyriflow/compare/accuracy.py", "np.sqrt(1 + 1 / n)", "np.sqrt(1 / n)"),
        ("src/gyriflow/compare/accuracy.py", "tested.coverage), tested.largest)", "tested.coverage), 0.0)"),
        ("src/gyriflow/compare/accuracy.py", "max(widest, half)", "half"),
        ("src/gyriflow/compare/accuracy.py", "logs.mean() - tested.bias", "logs.mean() + tested.bias"),
    ],
    "compare/test_deviation.py": [
        ("src/gyriflow/compare/deviation.py", "SMOOTHING_MM = 3.0", "SMOOTHING_MM = 0.0"),
        ("src/gyriflow/compare/deviation.py", " * expected_mm / start_mm", ""),
    ],
    "compare/test_calibration.py": [
        ("src/gyriflow/compare/calibration.py", "- finished.min()", "- finished.max()"),
        (
            "src/gyriflow/compare/calibration.py",
            '.abs().groupby("band").mean()',
            '.groupby("band").mean().abs()',
        ),
        ("src/gyriflow/compare/calibration.py", '1 - row["r_shape_index"]', '1 - row["r_mean_curvature"]'),
    ],
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
        ("src/gyriflow/report/tables.py", "core_hours=hours.max(axis=1)", 'core_hours=hours["cpu_s"]')
    ],
    "report/test_report_scripts.py": [
        ("workflow/scripts/study_records.py", '"inputs": inputs[brain["id"]]', '"inputs": {}'),
        ("workflow/scripts/run_tables.py", 'settings["growth_of"] = grown', 'settings["growth_of"] = ""'),
    ],
    "io/test_exports.py": [
        ("src/gyriflow/quantities.py", '"sulcal_depth_mm", "mm"', '"sulcal_depth_mm", "1"'),
        ("src/gyriflow/io/exports.py", "_hemi-{side[0].upper()}{desc}_{kind}", "_hemi-L{desc}_{kind}"),
        ("src/gyriflow/io/made_files.py", " if path not in others}", "}"),
        ("src/gyriflow/quantities.py", "export_sign=-1", "export_sign=1"),
    ],
    "io/test_volumes.py": [
        ("src/gyriflow/io/volumes.py", "moved[:3, 3] += moved[:3, :3] @", "moved[:3, 3] += np.abs(moved[:3, :3]) @"),
        ("src/gyriflow/io/volumes.py", "int(filled[0]) - 1, 0", "int(filled[0]), 0"),
        ("src/gyriflow/io/volumes.py", "nib.MGHImage) and not", "nib.MGHImage) and"),
    ],
    "io/test_surfaces.py": [
        ("src/gyriflow/io/surfaces.py", "STRUCTURES.values() and structure !=", "STRUCTURES.values() and structure =="),
        ("src/gyriflow/io/surfaces.py", "REAL_RAS, start.end() + 8", "REAL_RAS, start.end() + 4"),
        ("src/gyriflow/io/vtk_files.py", 'content, "<i4"', 'content, ">i4"'),
    ],
    # simulations, jobs and exit codes
    # feedback, limits and the layer of growth
    "folding/test_targets.py": [
        (
            "src/gyriflow/folding/targets.py",
            "back = (1 - np.exp((week - end) / FEEDBACK_GW)) * misfit",
            "back = 0 * misfit",
        ),
        ("src/gyriflow/folding/targets.py", "if misfit_mm > FEEDBACK_FROM_MM:", "if True:"),
    ],
    "folding/test_steering.py": [
        (
            "src/gyriflow/folding/steering.py",
            "weight, volumes = cortical_weight(distance, thickness)",
            "weight, volumes = cortical_weight(distance, 1.02 * thickness)",
        ),
    ],
    "folding/test_elastic_fit.py": [
        (
            "src/gyriflow/folding/elastic_fit.py",
            "self.positions_mm + displacement), limit=MAX_LOG_STRETCH",
            "self.positions_mm + displacement), limit=9.0",
        ),
    ],
    "folding/test_simulation.py": [
        (
            "src/gyriflow/folding/simulation.py",
            'folding.domain.order) if has_layers else ""',
            "folding.domain.order)",
        ),
    ],
    "geometry/test_paths.py": [
        ("src/gyriflow/geometry/paths.py", "np.exp(-((distance / STRAIGHT_MM) ** 2))[:, None]", "1.0"),
        ("src/gyriflow/geometry/paths.py", "np.exp(-((distance / STRAIGHT_MM) ** 2))[:, None]", "0.0"),
    ],
    "test_splines.py": [
        ("src/gyriflow/splines.py", "freedom <= lowest + FREEDOM_TOL", "freedom <= lowest"),
        ("src/gyriflow/splines.py", "freedom >= highest - FREEDOM_TOL", "freedom >= highest"),
    ],
    "folding/test_stress.py": [("src/gyriflow/folding/stretches.py", "-step_gw / memory_gw", "-memory_gw / step_gw")],
    "cli/test_scan_ages.py": [
        ("src/gyriflow/study/participants.py", "is_only_scan &= len({*sessions, session} - {None}) < 2", "pass"),
    ],
    "cli/test_checking.py": [
        ("src/gyriflow/running/cost.py", '"tetgen": 2.2', '"tetgen": 22'),
        (
            "src/gyriflow/cli/check.py",
            "max(sum(seconds) / cores, *map(end_s, range(len(jobs))))",
            "sum(seconds) / cores",
        ),
        ("src/gyriflow/cli/check.py", "seconds[number] / min(jobs[number].threads, cores)", "seconds[number]"),
        ("src/gyriflow/cli/check.py", "for each in needs), reverse=True)", "for each in needs))"),
    ],
    "running/test_terminal.py": [
        ("src/gyriflow/running/status.py", '"mesh": "mesh/brain.xdmf"', '"mesh": "surface/pial.surf.gii"'),
        ("src/gyriflow/running/status.py", '"metrics/week-*/metrics.csv"', '"surfaces/week-*/pial.surf.gii"'),
    ],
    "running/test_snakemake_internals.py": [
        ("src/gyriflow/running/snakemake_internals.py", "in REMOVED and made.has_its_date", "in REMOVED"),
        ("src/gyriflow/running/snakemake_internals.py", "content not in earlier", "content in earlier"),
    ],
    "running/test_jobs.py": [("src/gyriflow/running/jobs.py", "st_mtime >= since_s", "st_mtime < since_s")],
    "io/test_files.py": [
        ("src/gyriflow/errors.py", "exit_code = 5", "exit_code = 1"),
        ("src/gyriflow/io/files.py", "dtype=types, keep", "keep"),
        ("src/gyriflow/io/files.py", "keep_default_na=False", "keep_default_na=True"),
    ],
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
