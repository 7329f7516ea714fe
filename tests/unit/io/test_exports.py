"""Exports hold what was measured, under names of their own or of BIDS derivatives."""

import json
import shutil

import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from facts import Facts
from processes import ran
from recording import contents
from shapes import HALF_AXES, ellipsoid, scaling, sphere

from gyriflow.errors import InputError
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import transformed
from gyriflow.io.exports import ExportedBrain, export_bids, publish_derivatives
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import (
    read_surface,
    read_vertex_maps,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)
from gyriflow.io.volumes import (
    LabelSource,
    LabelVolume,
    write_label_volume,
)
from gyriflow.io.yaml_files import SCHEMES

VALIDATOR = shutil.which("bids-validator-deno")
COLUMNS = {"area": ("pial area", "cm2")}
POSE = np.array([[0.0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
"""A quarter turn and 5 mm."""


SIDES = {"left": -1, "right": 1}


def hemisphere(side):
    """Return an ellipsoid of few vertices in place of a hemisphere."""
    return ellipsoid(HALF_AXES, 2, centre=(12.5 * side, 0.0, 0.0))


@pytest.fixture
def brain(tmp_path):
    """A brain whose pial surfaces were posed by `POSE`, with maps and regions."""
    surfaces, maps, regions = {}, {}, {}
    for side, sign in SIDES.items():
        mesh = hemisphere(sign)
        number = np.arange(len(mesh.vertices))
        values = {"sulcal_depth_mm": number / 7, "thickness_mm": number / 9}
        surfaces[side] = str(tmp_path / f"{side}.pial.surf.gii")
        maps[side] = str(tmp_path / f"{side}.shape.gii")
        regions[side] = str(tmp_path / f"{side}.regions.label.gii")
        write_surface(surfaces[side], transformed(mesh, POSE))
        write_vertex_maps(maps[side], values)
        write_vertex_labels(regions[side], number % 2, {1: "frontal"})
    write_json(tmp_path / "surface.json", {"pose": Pose(POSE).plain()})
    return ExportedBrain(
        brain="case_1",
        run="observed",
        week=22.43,
        subject="case_1",
        surfaces=surfaces,
        maps=maps,
        regions=regions,
        report=str(tmp_path / "surface.json"),
        covariates={},
    )


@pytest.fixture
def scans(brain):
    """Two sessions of a subject and one of another."""
    rows = [
        ("sub-01_ses-1", 21.0, {"sex": "F", "tesla": "1.5"}),
        ("sub-01_ses-2", 24.43, {"sex": "F", "tesla": "3"}),
        ("sub-02_ses-1", 22.0, {"sex": "M", "tesla": "3"}),
    ]
    return [
        brain._replace(brain=name, subject=name[:6], week=week, covariates=covariates)
        for name, week, covariates in rows
    ]


def exported(folder, brains, **tables):
    """Export brains with tables of one row each, and return the folder of the first
    subject's files."""
    rows = {name: pd.DataFrame([row]) for name, row in tables.items()}
    export_bids(folder, brains, rows, "1.2.3", COLUMNS)
    return next(folder.glob("sub-*"), folder) / "anat"


def test_a_study_is_a_bids_derivative(tmp_path, brain):
    folder, simulated = tmp_path / "bids", brain._replace(run="run-a", week=24.0)
    place = exported(folder, [brain, simulated])
    # in the world of the volumes
    right = read_surface(place / "sub-case1_hemi-R_pial.surf.gii")
    np.testing.assert_allclose(right.vertices, hemisphere(1).vertices, atol=1e-5)
    (depth,) = read_vertex_maps(place / "sub-case1_hemi-L_sulc.shape.gii").items()
    assert depth[0] == "sulc"
    np.testing.assert_allclose(depth[1][:3], [0, -1 / 7, -2 / 7], rtol=1e-6)
    # what has no value, and how much of it
    thickness = read_json(folder / "thickness.json")["Description"]
    assert thickness == Facts("NaN", "thickness_measured_share")
    _, description = (folder / "descriptions.tsv").read_text().splitlines()
    assert description == Facts("desc-runagw2400\t", "run-a", 24)


def test_a_map_without_a_name_in_bids_ends_the_export(tmp_path, brain):
    write_vertex_maps(brain.maps["left"], {"unheard_of": np.zeros(5)})
    with pytest.raises(KeyError, match="unheard_of"):
        exported(tmp_path / "bids", [brain])


# as the HCP and smriprep's inverted maps have them: larger on gyri, thickness positive,
# lengths in mm
OTHER_TOOLS = {
    "curv": (1, "1/mm", "gyri"),
    "sulc": (1, "mm", "gyri"),
    "thickness": (1, "mm", ""),
    "shapeIndex": (1, "arbitrary", "gyri"),
}


def test_maps_under_names_of_other_tools_have_their_signs_and_units(tmp_path, brain):
    on_gyri = np.where(np.arange(len(hemisphere(-1).vertices)) % 3 == 0, 1.0, -1.0)
    own_maps = {
        "mean_curvature": 0.3 * on_gyri,
        "sulcal_depth_mm": 4 - 4 * on_gyri,
        "thickness_mm": 2 + 0.5 * on_gyri,
        "shape_index": 0.5 * on_gyri,
    }
    for path in brain.maps.values():
        write_vertex_maps(path, own_maps)
    place = exported(tmp_path / "bids", [brain])
    for name, (sign, unit, word) in OTHER_TOOLS.items():
        described = read_json(tmp_path / "bids" / f"{name}.json")
        assert described["Units"] == unit
        assert word in described["Description"]
        for side, structure in (("L", "CortexLeft"), ("R", "CortexRight")):
            path = place / f"sub-case1_hemi-{side}_{name}.shape.gii"
            (values,) = read_vertex_maps(path).values()
            assert (np.sign(values - values.mean()) == sign * on_gyri).all()
            assert nib.load(path).meta["AnatomicalStructurePrimary"] == structure


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        # of one week
        ([{"brain": "a"}, {"brain": "b"}], ["sub-case1_ses-2243w", "a", "b"]),
        # of several weeks
        ([{"subject": "1-12"}, {"subject": "11-2", "week": 23}], ["1-12", "11-2"]),
        ([{"subject": "sub-01"}, {"subject": "01", "week": 23}], ["sub-01", "01"]),
        ([{"subject": "müller"}, {"subject": "möller", "week": 23}], ["sub-mller"]),
        # a disk that ignores case has one folder for both
        ([{"subject": "sub-a"}, {"subject": "sub-A", "week": 23}], ["sub-a", "sub-A"]),
        ([{}, {"run": "b-1"}, {"run": "b.1", "week": 25}], ["b1", "b-1", "b.1"]),
        # without letters and digits
        ([{}, {"subject": "--", "week": 23}], ["subject", "--"]),
        ([{}, {"run": "--"}], ["run", "--"]),
    ],
)
def test_brains_without_a_label_of_their_own_in_bids_are_refused(
    tmp_path, brain, changes, facts
):
    brains = [brain._replace(**change) for change in changes]
    with pytest.raises(InputError, check=Facts(*facts)):
        exported(tmp_path / "bids", brains)
    assert not (tmp_path / "bids").exists()


WIDE = {"subject": "sub-01_ses-1", "run": "observed", "week": 21.0, "area": 3.5}


def touched(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return path


def names_in(folder):
    return {path.name for path in folder.rglob("*") if path.is_file()}


def test_derivatives_are_published_beside_files_of_others(tmp_path, scans):
    made, folder, source = (tmp_path / name for name in ("made", "out", "source"))
    exported(made, scans, metrics_wide=WIDE)
    touched(tmp_path / "brains" / "sub-01_ses-1" / "figures" / "quality.png")
    other = touched(folder / "sub-01" / "anat" / "of_another_program.nii")
    publish_derivatives(made, folder, source, ["sub-01_ses-1"], whole=False)
    assert {".bidsignore", "sub-02_sessions.tsv", other.name} <= names_in(folder)
    assert (folder / "sub-01" / "figures" / "sub-01_ses-1_quality.png").exists()
    assert not (folder / "participants.tsv").exists()
    write_json(source / "dataset_description.json", {"DatasetDOI": "10.1/x"})
    for name in ("sub-01_ses-1", "crl-22"):
        touched(tmp_path / "report" / "brains" / f"{name}.html")
    # a session that is no more, of which a user has kept a note
    for path in (made / "sub-01" / "ses-2").rglob("*.gii"):
        path.unlink()
    touched(folder / "sub-01" / "ses-2" / "note.txt")
    # again and again: the note does not become one of the files that may be removed
    for _ in range(2):
        publish_derivatives(made, folder, source, ["sub-01_ses-1"], whole=True)
    assert names_in(folder / "sub-01" / "ses-2") == {"note.txt"}
    assert (folder / "participants.tsv").exists()
    # the report leads to brains of an atlas, too
    assert names_in(folder / "brains") == {"sub-01_ses-1.html", "crl-22.html"}
    described = read_json(folder / "dataset_description.json")
    assert described["SourceDatasets"] == [{"URL": "doi:10.1/x"}]


def test_a_data_set_of_another_program_is_left(tmp_path, scans):
    made, description = tmp_path / "made", tmp_path / "out/dataset_description.json"
    exported(made, scans)
    write_json(description, {"GeneratedBy": [{"Name": "fMRIPrep"}]})
    with pytest.raises(InputError, check=Facts(description, "OUT")):
        publish_derivatives(made, description.parent, tmp_path, [], whole=True)
    assert names_in(description.parent) == {description.name}


def labels_of(folder):
    """Return a volume of labels, and the sphere and its thickness that those of a
    simulated brain are made of."""
    volume, surface, thickness = (
        str(folder / name) for name in ("l.nii.gz", "whole.surf.gii", "t.shape.gii")
    )
    labels = np.ones((40, 40, 20), np.int32)
    write_label_volume(volume, LabelVolume(labels, scaling((1, 1, 2), -20)))
    ball = sphere(10.0)
    write_surface(surface, transformed(ball, POSE))
    write_vertex_maps(thickness, {"thickness_mm": np.full(len(ball.vertices), 3.0)})
    source = LabelSource(volume, "auto", SCHEMES["binary"])
    return {"labels": source, "surface": surface, "thickness": thickness}


@pytest.fixture
def sessions(tmp_path, brain, scans):
    """The export of scans with all that they may have."""
    folder = tmp_path / "sessions"
    surfaces, white_maps, template_maps = {}, {}, {}
    for side, sign in SIDES.items():
        mesh = transformed(hemisphere(sign), POSE @ scaling(0.5))
        depth = np.arange(len(mesh.vertices)) / 5
        surfaces[side] = str(tmp_path / f"{side}.white.surf.gii")
        white_maps[side] = str(tmp_path / f"{side}.white.shape.gii")
        template_maps[side] = str(tmp_path / f"{side}.template.shape.gii")
        write_surface(surfaces[side], mesh)
        write_vertex_maps(white_maps[side], {"sulcal_depth_mm": depth})
        write_vertex_maps(template_maps[side], {"thickness_mm": depth[:9]})
    white = {"white": surfaces, "white_maps": white_maps}
    template = {"template": "sub-01_ses-1", "template_maps": template_maps}
    simulated = {"run": "run-a", "week": 23.5, "volume": labels_of(tmp_path)}
    brains = [scan._replace(**white, **template) for scan in scans]
    brains.append(scans[0]._replace(**template, **simulated))
    exported(folder, brains, metrics_wide=WIDE)
    return folder


def undescribed(values):
    """Return the content of a JSON file without its descriptions."""
    if isinstance(values, dict):
        return {
            key: undescribed(value)
            for key, value in values.items()
            if key != "Description"
        }
    return values


def test_files_of_exports(tmp_path, brain, sessions, recorded):
    # a table often has the age at birth beside that at the scan
    covariates = {"gestational_age": "39.1", "brain": "left", "session_id": "b"}
    row = {"subject": "case_1", "week": 22.43, "depth": np.nan} | covariates
    brains = [brain._replace(covariates=covariates), brain._replace(run="a", week=23)]
    exported(tmp_path / "plain", brains, metrics_wide=row)
    files = {}
    for folder in (tmp_path / "plain", sessions):
        for path in sorted(folder.rglob("*.*")):
            content = undescribed(contents(path))
            if path.suffix == ".tsv":
                content = path.read_text().splitlines()
            if path.name.endswith(".surf.gii"):
                content["named"] = " ".join(nib.load(path).darrays[0].meta.values())
            if path.suffix != ".md":
                files[str(path.relative_to(tmp_path))] = content
    recorded(files)


@pytest.mark.skipif(
    not VALIDATOR,
    reason="no bids-validator-deno on PATH: pip install bids-validator-deno",
)
def test_the_bids_validator_finds_no_error(sessions):
    done = ran(VALIDATOR, sessions, "--format", "json")
    found = json.loads(done.stdout)["issues"]["issues"]
    assert [issue for issue in found if issue["severity"] == "error"] == []
