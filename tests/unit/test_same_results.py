"""The comparison of two results folders notices every change, and nothing else."""

import json

import h5py
import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from same_results import compare


def write(
    folder,
    *,
    value=1.0,
    height=3.0,
    column="area",
    file="metrics.csv",
    verdict="look",
    seconds=1.0,
    mm=5.0,
):
    """Write a results folder with a file of each kind."""
    study = folder / "demo" / "results" / "study"
    study.mkdir(parents=True)
    pd.DataFrame(
        {"brain": ["a", "b"], "verdict": verdict, column: [value, 2.0]}
    ).to_csv(study / file, index=False)
    summary = {
        "min_J": value,
        "seconds": seconds,
        "mesh": f"{folder}/brain.xdmf",
        "weeks": [21.0, None],
    }
    (study / "summary.json").write_text(json.dumps(summary))
    with h5py.File(study / "frames.h5", "w") as frames:
        frames["week_21.00/positions"] = np.array([[1e-7, height, np.nan]])
    points = nib.gifti.GiftiDataArray(
        np.array([[mm, 0, 0]], dtype=np.float32), intent="NIFTI_INTENT_POINTSET"
    )
    nib.save(nib.gifti.GiftiImage(darrays=[points]), study / "pial.surf.gii")
    return folder


def compare_with(tmp_path, changes, renamed=None):
    return compare(
        write(tmp_path / "before"), write(tmp_path / "after", **changes), renamed or {}
    )


def test_equal_results_are_equal_whatever_their_times_and_folders(tmp_path):
    lines, summary = compare_with(tmp_path, {"seconds": 2.0})
    assert lines == []
    assert summary["files"] == 4
    assert (
        summary["largest_relative_difference"],
        summary["only_before"],
        summary["only_after"],
    ) == (0.0, [], [])


@pytest.mark.parametrize(
    ("changes", "places"),
    [
        ({"value": 1.0 + 1e-6}, ["metrics.csv: area", "summary.json: min_J"]),
        ({"height": 3.0 * (1 + 1e-6)}, ["frames.h5: week_21.00/positions"]),
        ({"mm": 5.0 * (1 + 1e-6)}, ["pial.surf.gii: 0 "]),
        ({"verdict": "fine"}, ["metrics.csv: verdict"]),
        ({"height": np.nan}, ["frames.h5: week_21.00/positions"]),
    ],
)
def test_a_change_is_found_in_every_kind_of_file(tmp_path, changes, places):
    lines, summary = compare_with(tmp_path, changes)
    assert len(lines) == len(places) == summary["differences"]
    assert all(
        line.startswith(f"demo/results/study/{place}: ")
        for line, place in zip(lines, places, strict=True)
    )
    if changes != {"verdict": "fine"} and not np.isnan(changes.get("height", 0.0)):
        assert summary["largest_relative_difference"] == pytest.approx(1e-6, rel=0.1)


def test_a_rounding_in_single_precision_is_no_difference(tmp_path):
    lines, summary = compare_with(
        tmp_path, {"mm": float(np.nextafter(np.float32(5.0), np.float32(6.0)))}
    )
    assert lines == []
    assert 0 < summary["largest_relative_difference"] < 2e-7


def test_a_lost_file_and_a_new_one_are_named(tmp_path):
    _, summary = compare_with(tmp_path, {"file": "numbers.csv"})
    assert summary["only_before"] == ["demo/results/study/metrics.csv"]
    assert summary["only_after"] == ["demo/results/study/numbers.csv"]


def test_a_renamed_column_is_a_difference_unless_it_is_declared(tmp_path):
    changes = {"column": "area_mm2", "file": "numbers.csv", "verdict": "needs review"}
    lines, _ = compare(
        write(tmp_path / "a"), write(tmp_path / "b", column="area_mm2"), {}
    )
    assert lines == [
        f"demo/results/study/metrics.csv: area{end}"
        for end in (": only before", "_mm2: only after")
    ]
    lines, summary = compare_with(
        tmp_path,
        changes,
        {"area": "area_mm2", "metrics.csv": "numbers.csv", "look": "needs review"},
    )
    assert (lines, summary["only_before"], summary["only_after"]) == ([], [], [])
