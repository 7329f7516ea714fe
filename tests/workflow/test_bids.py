"""A BIDS data set in the real program: the whole list of output files, beside a scan
that cannot be read."""

import sys

import pytest
from facts import Facts
from processes import ran
from scan_trees import make_tree

pytestmark = pytest.mark.slow

SETTINGS = (
    "surface: {edge_length_mm: 3.0}\n"
    "metrics: {curvature_radius_mm: 7.0, spangy_modes: 50}\n"
)
SCAN = "sub-01/ses-1/anat/sub-01_ses-1"
MAPS = (
    "curv",
    "curvedness",
    "gaussCurv",
    "localGyrificationIndex",
    "reliable",
    "shapeIndex",
    "sulc",
)
PIAL_MAPS = (*MAPS, "spangyDominantBand", "spangyShapeIndexDominantBand", "thickness")
EXPECTED = {
    ".bidsignore",
    "README.md",
    "dataset_description.json",
    "descriptions.tsv",
    "sessions.json",
    *(f"{name}.json" for name in ("pial", "white", *PIAL_MAPS)),
    "sub-01/sub-01_sessions.tsv",
    "sub-01/figures/sub-01_ses-1_quality.png",
    *(
        f"{SCAN}_hemi-{side}_{layer}.surf.gii"
        for side in "LR"
        for layer in ("pial", "white")
    ),
    *(f"{SCAN}_hemi-{side}_{name}.shape.gii" for side in "LR" for name in PIAL_MAPS),
    *(
        f"{SCAN}_hemi-{side}_desc-white_{name}.shape.gii"
        for side in "LR"
        for name in MAPS
    ),
}


def test_the_files_of_a_participant_are_those_that_the_docs_list(tmp_path):
    make_tree(
        tmp_path / "data",
        labels=[f"derivatives/seg/{SCAN}_dseg.nii.gz"],
        text={"derivatives/seg/sub-02/sub-02_dseg.nii.gz": "torn"},
        tables={
            "participants.tsv": [
                "participant_id scan_age",
                "sub-01 24.0",
                "sub-02 25.0",
            ]
        },
    )
    (tmp_path / "settings.yaml").write_text(SETTINGS)
    arguments = ("data", "out", "participant", "--settings", "settings.yaml")
    outcome = ran(
        sys.executable, "-m", "gyriflow.cli", *arguments, timeout_s=600, cwd=tmp_path
    )
    assert outcome.returncode == 2, outcome.stderr
    assert outcome.stdout == Facts(
        "1 of 2 scans", "1 could not be read", "sub-02_dseg.nii.gz"
    )
    out = tmp_path / "out"
    files = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {file for file in files if not file.startswith("work/")} == EXPECTED
