"""The comparison of two results folders notices every change, and nothing else."""

import json

import h5py
import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from same_results import compare

STUDY = "demo/results/study"
MORE = 1.0 + 1e-6


def write(folder, mm=5.0, height=3.0, value=1.0, seconds=1.0, **table):
    """Write a results folder with a file of each kind, the table as a file with a
    column and a verdict."""
    table = {"file": "metrics.csv", "column": "area", "verdict": "look"} | table
    study = folder / STUDY
    study.mkdir(parents=True)
    columns = {"brain": ["a", "b"], "verdict": table["verdict"]}
    columns |= {table["column"]: [value, 2.0]}
    pd.DataFrame(columns).to_csv(study / table["file"], index=False)
    mesh = f"{folder}/brain.xdmf"
    summary = {"min_J": value, "seconds": seconds, "mesh": mesh, "weeks": [21.0, None]}
    (study / "summary.json").write_text(json.dumps(summary))
    with h5py.File(study / "frames.h5", "w") as frames:
        frames["week_21.00/positions"] = np.array([[1e-7, height, np.nan]])
    points = nib.gifti.GiftiDataArray(
        np.array([[mm, 0, 0]], dtype=np.float32), intent="NIFTI_INTENT_POINTSET"
    )
    nib.save(nib.gifti.GiftiImage(darrays=[points]), study / "pial.surf.gii")
    return folder


RENAMED = {"area": "area_mm2", "metrics.csv": "numbers.csv", "look": "needs review"}


@pytest.mark.parametrize(
    ("changes", "renamed", "places", "largest"),
    [
        # whatever their times and folders
        ({"seconds": 2.0}, {}, [], 0.0),
        ({"value": MORE}, {}, ["metrics.csv: area", "summary.json: min_J"], 1e-6),
        ({"height": 3.0 * MORE}, {}, ["frames.h5: week_21.00/positions"], 1e-6),
        ({"height": np.nan}, {}, ["frames.h5: week_21.00/positions"], None),
        ({"mm": 5.0 * MORE}, {}, ["pial.surf.gii: 0 "], 1e-6),
        # a rounding in single precision
        ({"mm": float(np.nextafter(np.float32(5.0), np.float32(6.0)))}, {}, [], 1e-7),
        ({"verdict": "fine"}, {}, ["metrics.csv: verdict"], None),
        (
            {"column": "area_mm2"},
            {},
            ["metrics.csv: area: only before", "metrics.csv: area_mm2: only after"],
            None,
        ),
        (
            {"column": "area_mm2", "file": "numbers.csv", "verdict": "needs review"},
            RENAMED,
            [],
            0.0,
        ),
    ],
)
def test_a_change_is_found_in_every_kind_of_file(
    tmp_path, changes, renamed, places, largest
):
    after = write(tmp_path / "after", **changes)
    lines, summary = compare(write(tmp_path / "before"), after, renamed)
    assert len(lines) == len(places) == summary["differences"]
    for line, place in zip(lines, places, strict=True):
        assert line.startswith(f"{STUDY}/{place}")
    if largest is not None:
        found = summary["largest_relative_difference"]
        assert found == pytest.approx(largest, rel=0.1)
    assert summary["only_before"] == summary["only_after"] == []


def test_a_lost_file_and_a_new_one_are_named(tmp_path):
    after = write(tmp_path / "after", file="numbers.csv")
    _, summary = compare(write(tmp_path / "before"), after, {})
    assert summary["files"] == 3
    assert summary["only_before"] == [f"{STUDY}/metrics.csv"]
    assert summary["only_after"] == [f"{STUDY}/numbers.csv"]
