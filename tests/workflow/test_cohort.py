"""A cohort in the real program: brains of one side, from a surface and from labels,
beside subjects that fail."""

from types import SimpleNamespace

import odd_brains
import pandas as pd
import pytest
from facts import Facts
from shapes import cerebrum_surface, phantom, save_labels

from gyriflow.geometry.triangles import area
from gyriflow.io.files import read_json
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.yaml_files import read_yaml

from .conftest import COARSE, Workflow

pytestmark = pytest.mark.slow

ROWS = (
    ("participant_id", "week", "sex", "files", "side", "scheme"),
    ("sub-01", "22", "F", "surface.surf.gii", "left", "n/a"),
    ("sub-02", "23", "M", "labels.nii.gz", "left", "spina-bifida-atlas"),
    ("sub-03", "23", "F", "torn.nii.gz", "n/a", "spina-bifida-atlas"),
    ("sub-04", "n/a", "F", "labels.nii.gz", "left", "spina-bifida-atlas"),
    ("sub-05", "23", "M", "labels.nii.gz", "n/a", "spina-bifida-atlas"),
)


def left_half(week):
    labels, affine = phantom(week, 2.0)
    return odd_brains.one_hemisphere(labels, affine, "left"), affine


@pytest.fixture(scope="module")
def cohort(checkout_copy, tmp_path_factory):
    """One call for surfaces, mesh, folding, metrics, pages and some figures."""
    workflow = Workflow(checkout_copy, tmp_path_factory.mktemp("cohort"))
    write_surface(
        workflow.directory / "surface.surf.gii", cerebrum_surface(*left_half(22.0))
    )
    save_labels(workflow.directory / "labels.nii.gz", *left_half(23.0))
    whole = (workflow.directory / "labels.nii.gz").read_bytes()
    (workflow.directory / "torn.nii.gz").write_bytes(whole[: len(whole) // 2])
    table = "\n".join("\t".join(row) for row in ROWS)
    (workflow.directory / "participants.tsv").write_text(table + "\n")
    config = {
        "participants": "participants.tsv",
        "start": "sub-01",
        "surface": {"edge_length_mm": 3.0},
        "mesh": COARSE | {"max_surface_distance_mm": 2.0},
        "metrics": {"curvature_radius_mm": 7.0, "spangy_modes": 50},
        "folding": {"end_week": 23, "step_s": 302400, "newton_tolerance": 1e-4},
    }
    name = workflow.write("study.yaml", config)
    refusal = workflow.run("-n", "--configfile", name)
    options = ("--cores", "2", "--keep-going", "--configfile", name)
    calls = [
        workflow.run(stage, *options, timeout_s=900)
        for stage in ("quality", "folding", "metrics")
    ]
    return SimpleNamespace(
        refusal=refusal, calls=calls, results=workflow.directory / "results"
    )


def test_rows_that_cannot_be_used_are_refused_before_any_job_without_keep_going(
    cohort,
):
    assert cohort.refusal.returncode == 2
    assert cohort.refusal.stderr == Facts("sub-04: week:", "n/a")


def test_a_failed_subject_holds_up_no_other_and_the_call_ends_in_its_code(cohort):
    # the folding of one brain needs none of those that fail, the table of metrics does
    assert [call.returncode for call in cohort.calls] == [2, 0, 2]
    said = cohort.calls[0].stderr
    assert "Traceback" not in said
    assert said == Facts("sub-04: week:", "n/a", "sub-03, sub-05")
    metrics = pd.read_csv(cohort.results / "study" / "metrics.csv")
    assert set(metrics["subject"]) == {"sub-01", "sub-02"}
    assert set(metrics["hemisphere"]) == {"whole", "left"}
    quality = pd.read_csv(cohort.results / "study" / "quality.csv")
    refused = quality[quality["verdict"] == "refused"]
    # a row of the table that cannot be used comes last
    assert refused["subject"].tolist() == ["sub-03", "sub-05", "sub-04"]
    assert refused["cause"].tolist()[-1] == Facts("n/a")


@pytest.mark.parametrize("brain", ["sub-01", "sub-02"])
def test_a_hemisphere_has_surfaces_and_maps_of_its_side_only(cohort, brain):
    folder = cohort.results / "brains" / brain
    assert (folder / "surface" / "left.pial.surf.gii").exists()
    assert (folder / "metrics" / "left.shape.gii").exists()
    assert not list(folder.rglob("right*"))
    report = read_json(folder / "surface" / "surface.json")
    assert report["side"] == "left"
    pial = read_surface(folder / "surface" / "pial.surf.gii")
    assert pial.vertices[:, 0].max() < report["fissure_x_mm"]


def test_a_hemisphere_folds_with_its_wall_in_its_plane(cohort):
    run = cohort.results / "runs" / "reference" / "sub-01"
    assert read_yaml(run / "params.yaml")["side"] == "left"
    zones = read_json(run / "folding" / "zones.json")["zones"]
    whole = area(read_surface(run / "surfaces" / "week-22.00" / "pial.surf.gii"))
    assert 0.05 < zones["medial wall"]["area_mm2"] / whole < 0.4
    assert zones["right contact"]["facets"] == zones["between planes"]["facets"] == 0
    start, end = (
        read_surface(run / "surfaces" / f"week-{week}" / "left.pial.surf.gii")
        for week in ("22.00", "23.00")
    )
    wall = start.vertices[:, 0].max()
    assert end.vertices[:, 0].max() < wall + 0.5
    assert area(end) > area(start)
    assert not (run / "surfaces" / "week-23.00" / "right.pial.surf.gii").exists()
