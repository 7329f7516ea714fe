"""Scripts of the workflow that only read, call and write: each takes its files by role,
side and unit, and all of them.

Sides differ in size, files in content and number, so that none stands for another.
"""

import h5py
import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from ellipsoid import RUN
from local_server import Server, gifti, serving, sha256
from scripts import run_script
from shapes import (
    FAR,
    LONG_MM,
    ellipsoid,
    inner,
    moved,
    octasphere,
    save_labels,
    sphere,
)

from gyriflow.anatomy.fissure import split
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.triangles import transformed
from gyriflow.io import downloads
from gyriflow.io.exports import ExportedBrain
from gyriflow.io.files import read_json, read_table, write_json, write_table
from gyriflow.io.registrations import (
    WeeklyShapes,
    write_weekly_shapes,
)
from gyriflow.io.surfaces import (
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)
from gyriflow.io.volumes import LabelSource
from gyriflow.io.yaml_files import SCHEMES, write_yaml
from gyriflow.metrics.spangy import PART_POWERS
from gyriflow.settings.schemes import LabelScheme
from gyriflow.settings.terms import SIDES
from gyriflow.shipped import SHIPPED
from gyriflow.units import SECONDS_PER_GW

ALL_OUTPUTS = pytest.mark.usefixtures("recorded_outputs")
NORMS = SHIPPED / "norms"


def structure_of(path):
    """Return the side that a GIFTI file names, of a surface or of maps."""
    image = nib.load(path)
    name = "AnatomicalStructurePrimary"
    return image.meta.get(name) or image.darrays[0].meta[name]


def write_frames(path, growth_by_week):
    """Write a tetrahedron with a log growth per step since the week before."""
    with h5py.File(path, "w") as file:
        file["tets"] = [[0, 1, 2, 3]]
        for week, growth in growth_by_week.items():
            group = file.create_group(f"week_{week:.2f}")
            group["positions"] = 10.0 * np.eye(4, 3)
            group["tangential_growth_per_step"] = np.full(4, growth)
            group["radial_growth_per_step"] = np.full(4, 2 * growth)
            group["growth_direction_per_step"] = np.eye(4, 3)
            group["cell_fields/J"] = np.ones(1)


@ALL_OUTPUTS
def test_growth_maps_are_of_each_interval_and_their_deviation_is_of_the_members(
    tmp_path,
):
    steps = 8
    write_yaml(tmp_path / "params.yaml", RUN | {"step_s": SECONDS_PER_GW / steps})
    runs = {"run": (0.01, 0.03), "one": (0.02, 0.04), "two": (0.025, 0.07)}
    for name, (first, second) in runs.items():
        growth = {21.0: 0.0, 22.0: first, 23.5: second}
        write_frames(tmp_path / f"{name}.h5", growth)
        inputs = {"frames": f"{name}.h5", "params": "params.yaml"}
        run_script("growth_maps.py", tmp_path, inputs, {0: f"{name}.shape.gii"})
    inputs = {"run": "run.shape.gii", "members": ["one.shape.gii", "two.shape.gii"]}
    run_script("growth_sd.py", tmp_path, inputs, {0: "sd.shape.gii"})


@ALL_OUTPUTS
def test_a_kept_path_is_copied_whole(tmp_path):
    random = np.random.default_rng(5)
    weeks = np.array([21.0, 22.0, 24.5])
    kept = WeeklyShapes(
        weeks,
        random.normal(size=(3, 6, 3)),
        {"area_cm2": np.array([90.0, 100.0, 140.0])},
        {"own": list(random.normal(size=(3, 4, 3)))},
        pd.DataFrame({"week": weeks}),
        stops=(22.0,),
        between=(24.5,),
        tets=np.array([[0, 1, 2, 3], [2, 1, 4, 5]]),
        made_from="a key",
    )
    write_weekly_shapes(tmp_path / "kept.h5", kept)
    params = {"kept": str(tmp_path / "kept.h5")}
    run_script("kept_path.py", tmp_path, {}, {0: "path.h5"}, params)


@ALL_OUTPUTS
def test_regions_of_each_side_are_measured_with_its_own_surface_maps_and_names(
    tmp_path,
):
    inputs = {}
    for number, side in enumerate(SIDES, start=1):
        mesh = sphere(10.0 * number, 3)
        write_surface(tmp_path / f"{side}.gii", mesh)
        thickness = {"thickness_mm": np.full(len(mesh.vertices), 1.0 + number)}
        write_vertex_maps(tmp_path / f"{side}.shape.gii", thickness)
        labels = np.where(mesh.vertices[:, 2] > 0, number, 0)
        names = {number: f"top {side}"}
        write_vertex_labels(tmp_path / f"{side}.label.gii", labels, names)
        inputs |= {side: f"{side}.gii", f"{side}_maps": f"{side}.shape.gii"}
        inputs[f"{side}_regions"] = f"{side}.label.gii"
    params = {"columns": {"subject": "a", "run": "observed", "week": 22.5}}
    run_script("region_metrics.py", tmp_path, inputs, {0: "regions.csv"}, params)


WEEKS = 25.0 + 0.1 * np.arange(12)
AREAS = 10 * WEEKS + np.tile([1.0, -1.0], 6)
BRAINS = [f"b{number:02d}" for number in range(12)]
ODD = ["1e5", "NA", "None", "true", "1.0", "2024-01-01", "1e2", "2e2"]
ODD += [f"{number:03d}" for number in range(4)]


def metrics_of(brain, week, area_cm2, run="observed"):
    """Return the areas of the sides of a brain, the left one the larger by a tenth."""
    sides = {"whole": 1.0, "left": 11 / 21, "right": 10 / 21}
    table = pd.DataFrame({"hemisphere": list(sides), "metric": "area", "unit": "cm2"})
    values = area_cm2 * np.array(list(sides.values()))
    return table.assign(subject=brain, run=run, week=week, value=values)


def write_study(folder, brains, run, region):
    """Write the tables of twelve brains, of which the first two are scans of one
    subject and have spectra, the first a region, and a run of it."""
    first, second, *_ = brains
    rows = list(map(metrics_of, brains, WEEKS, AREAS))
    rows.append(metrics_of(first, WEEKS[1], 260.0, run))
    rows.append(metrics_of(first, WEEKS[0], 249.0, run))
    write_table(folder / "metrics.csv", pd.concat(rows))
    of_region = metrics_of(first, WEEKS[0], 21.0).assign(region=region)
    write_table(folder / "regions.csv", of_region)
    bands = pd.DataFrame({"band": range(1, 7)})
    bands = bands.assign(wavelength_max_mm=256 / 2.0 ** bands["band"], is_open=False)
    common = {"hemisphere": "left", "proxy": "mean_curvature", "run": "observed"}
    common |= {"complete": True, "resolved": True, "week": 25.0}
    # nearly all power, one octave further
    powers = np.eye(6)[3] + 1e-9
    spectra = []
    for brain, power in ((first, powers), (second, np.roll(powers, 1))):
        of_brain = bands.assign(subject=brain, **common)
        of_brain[PART_POWERS] = power[:, None] * np.ones(16)
        spectra.append(of_brain)
    write_table(folder / "spectra.csv", pd.concat(spectra))
    noise = {"metrics": {"area": {"cv": 0.01}}, "distances": {}}
    noise["distances"]["spectral_distance_B4_to_B5"] = 0.07
    write_yaml(folder / "noise.yaml", noise)
    for name, ml in (("first", 2.0), ("second", 3.0)):
        write_json(folder / f"{name}.json", {"volumes_by_number_mL": {"7": ml}})
    values = {"whole": {"area": [200.0, 300.0]}}
    atlases = {"one": {"weeks": [24.0, 26.0], "values": values}}
    write_yaml(folder / "atlases.yaml", {"made_with": MADE_WITH, "atlases": atlases})


MADE_WITH = {"edge_length_mm": 1.0}
TABLES = ["metrics", "metrics_long", "metrics_wide", "change", "asymmetry"]
TABLES += ["norm_curves", "centiles", "spectral_distance", "volumes"]
TABLES += ["published_centiles", "atlas_curves", "atlas_differences"]


def metrics_tables(folder, brains=BRAINS, run="run", region="insula", cohort=()):
    """Write a study and run the script on it, with the norms of others if there are
    any; return the tables by their names."""
    folder.mkdir(exist_ok=True)
    write_study(folder, brains, run, region)
    first, second, _, fourth, *_ = brains
    inputs = {name: [f"{name}.csv"] for name in ("metrics", "spectra", "regions")}
    inputs |= {"labelled": ["first.json", "second.json"], "cohort": list(cohort)}
    inputs |= {"noise": "noise.yaml", "norms": str(NORMS / "svrtk-volumes.yaml")}
    inputs["atlases"] = "atlases.yaml"
    outputs = {name: f"{name}.out.csv" for name in TABLES}
    params = {
        "labelled": [
            (first, 25.0, SIDES, SCHEMES["dhcp-19"]),
            (fourth, 29.0, ("left",), SCHEMES["dhcp-19"]),
        ],
        "scans": {first: [first, second]},
        "covariates": {second: {"sex": "F", "site": "07"}},
        "reference": [] if cohort else brains,
        "individuals": True,
        "subjects": {brain: brain for brain in brains} | {second: first},
        "made_with": MADE_WITH,
        "population": ["other" if cohort else "normal"],
    }
    outputs_and_norms = outputs | {"norms": "copied.json" if cohort else "norms.json"}
    run_script("metrics_tables.py", folder, inputs, outputs_and_norms, params)
    return {name: read_table(folder / file) for name, file in outputs.items()}


def require_equal_tables(plain, odd):
    """Check that tables are the same in which brains, runs and regions have odd
    names."""
    letters = dict(zip(ODD, BRAINS, strict=True)) | {"1": "run"}
    places = ("subject", "run", "observed", "from_brain", "to_brain", "person")
    for name, expected in plain.items():
        found = odd[name].rename(columns=lambda text: text.replace("NA", "insula"))
        for column in set(places) & set(found):
            found[column] = found[column].map(lambda text: letters.get(text, text))
        if "region" in found:
            found["region"] = found["region"].replace("NA", "insula")
        keys = [key for key in expected if expected[key].dtype == object]
        found, expected = (
            table.sort_values(keys, kind="stable").reset_index(drop=True)
            for table in (found, expected)
        )
        assert len(found) > 0
        pd.testing.assert_frame_equal(found, expected)


@ALL_OUTPUTS
def test_tables_of_metrics_are_of_all_brains_regions_labels_and_scans(tmp_path):
    # names that look like numbers or nothing
    odd = metrics_tables(tmp_path / "odd", ODD, run="1", region="NA")
    plain = metrics_tables(tmp_path)
    require_equal_tables(plain, odd)
    scores = plain["centiles"].query("hemisphere == 'whole'")
    # eleven people: those of the other scan, and all for a run
    counts = scores.groupby("run")["brains"].agg(set).to_dict()
    assert counts == {"observed": {10}, "run": {11}}
    # the norms of this study score the brains of another
    new = metrics_tables(tmp_path, cohort=["norms.json"])["centiles"]
    assert set(new.query("hemisphere == 'whole'")["brains"]) == {11}


@ALL_OUTPUTS
@pytest.mark.parametrize("individuals", [True, False])
def test_tables_of_all_runs_are_joined_and_individuals_have_centiles(
    tmp_path, individuals
):
    subjects = [f"s{number}" for number in range(12)]
    weeks = 25.0 + 0.1 * np.arange(12.0)
    for run, usual in (("a", 0.0), ("b", 50.0)):
        columns = {"run": run, "start": subjects, "subject": subjects, "week": weeks}
        columns |= {"hemisphere": "whole", "region": "", "metric": "distance"}
        values = usual + np.tile([1.0, -1.0], 6)
        deviation = pd.DataFrame(columns | {"value": values, "unit": "mm"})
        write_table(tmp_path / f"deviation.{run}.csv", deviation)
        validation = pd.DataFrame({"run": [run], "r": [usual]})
        write_table(tmp_path / f"validation.{run}.csv", validation)
    names = ("deviation", "validation")
    inputs = {name: [f"{name}.a.csv", f"{name}.b.csv"] for name in names}
    inputs["prediction"] = []
    outputs = {name: f"{name}.csv" for name in (*names, "deviation_centiles")}
    params = {"individuals": individuals}
    run_script("validation_tables.py", tmp_path, inputs, outputs, params)


PIAL_MM, WHITE_MM = 20.0, 16.0
TWO = LabelScheme(name="two", cerebrum=(1, 2), cortex=(2,))


def write_halves(folder):
    """Write the left and right half of a sphere, moved by 2 mm to the left, and the
    pose that they have been brought to."""
    for side, half in zip(SIDES, split(sphere(PIAL_MM, 4), 0.0), strict=True):
        write_surface(folder / f"{side}.gii", moved(half, -2.0))
    pose = Pose(FAR[0], {"left": FAR[1], "right": FAR[1], "whole": FAR[1]})
    report = {"pose": pose.plain(), "fissure_x_mm": -2.0}
    write_json(folder / "surface.json", report)


def white_made(folder, inputs, sides=SIDES, **params):
    """Run the script that makes white surfaces, each with the name of its side."""
    params = {"labels": None, "white": {}, "curvature_radius_mm": 5.0} | params
    params["columns"] = {"subject": "a", "run": "observed", "week": 22.5}
    params["surface"] = {"edge_length_mm": 2.0}
    outputs = {"metrics": "metrics.csv"}
    for side in sides:
        outputs[f"{side}_surface"] = f"{side}.white.gii"
        outputs[f"{side}_maps"] = f"{side}.shape.gii"
    inputs = {"report": "surface.json", "given": [], **inputs}
    run_script("white.py", folder, inputs, outputs, params)
    for side in sides:
        for file in (f"{side}.white.gii", f"{side}.shape.gii"):
            assert structure_of(folder / file) == f"Cortex{side.title()}"


@ALL_OUTPUTS
@pytest.mark.remeshed
def test_white_surfaces_of_labels_are_posed_as_volumes_are(tmp_path):
    write_halves(tmp_path)
    size = 2 * np.array(LONG_MM)
    axes = [np.arange(-23, 23, step) for step in size]
    affine = np.diag([*size, 1.0])
    affine[:3, 3] = -23.0
    affine[0, 3] -= 2.0
    radius = np.sqrt(sum(np.square(np.meshgrid(*axes, indexing="ij"))))
    labels = np.where(radius < WHITE_MM, 1, np.where(radius < PIAL_MM, 2, 0))
    path = tmp_path / "labels.nii.gz"
    save_labels(path, labels, np.linalg.inv(FAR[0]) @ affine)
    inputs = {side: f"{side}.gii" for side in SIDES}
    source = LabelSource(str(path), "auto", TWO)
    white_made(tmp_path, inputs, labels=source)


@ALL_OUTPUTS
@pytest.mark.remeshed
def test_white_surfaces_of_files_are_posed_as_files_are(tmp_path):
    write_halves(tmp_path)
    given = {"left": ellipsoid((8.0, 14.0, 12.0), 3), "right": sphere(7.0, 3)}
    paths = {}
    for side, mesh in given.items():
        paths[side] = str(tmp_path / f"given.{side}.gii")
        write_surface(paths[side], transformed(mesh, np.linalg.inv(FAR[1])))
    inputs = {side: f"{side}.gii" for side in SIDES}
    white_made(tmp_path, inputs, white=paths)
    # a brain of one hemisphere
    right = {"right": paths["right"]}
    inputs = {"right": "right.gii", "left": None}
    white_made(tmp_path, inputs, ["right"], white=right)
    assert set(read_table(tmp_path / "metrics.csv")["hemisphere"]) == {"right", "whole"}


@ALL_OUTPUTS
@pytest.mark.parametrize(
    ("has_white", "similar"),
    [(True, None), (False, {"mean_mm": 4.0, "voxel_mm": 1.5})],
)
def test_labels_are_filled_with_the_brain_s_cortex_or_that_of_a_similar_one(
    tmp_path, has_white, similar
):
    """Halves that are 1 mm apart are joined at their fissure, not at x = 0."""
    whole = octasphere(12.0, 4)
    parts = split(whole, 0.0)
    for sign, side, half in zip((-1, 1), SIDES, parts, strict=True):
        write_surface(tmp_path / f"{side}.gii", moved(half, -8.0 + sign * 0.01))
    write_surface(tmp_path / "whole.gii", moved(whole, -8.0))
    pose = Pose(FAR[0], {"whole": FAR[1]})
    report = {"pose": pose.plain(), "fissure_x_mm": -8.0}
    write_json(tmp_path / "surface.json", report)
    white = {}
    if has_white:
        white["whole"] = str(tmp_path / "white.gii")
        posed = moved(inner(whole, 3.0), -8.0)
        write_surface(white["whole"], transformed(posed, np.linalg.inv(FAR[1])))
    if similar:
        write_json(tmp_path / "similar.json", similar)
    inputs = {"whole": "whole.gii", "sides": ["left.gii", "right.gii"]}
    inputs |= {"report": "surface.json", "white": [f"{name}.gii" for name in white]}
    inputs["similar"] = "similar.json" if similar else None
    outputs, params = {0: "filled.nii.gz"}, {"white": white}
    run_script("filled_labels.py", tmp_path, inputs, outputs, params)


@ALL_OUTPUTS
@pytest.mark.remeshed
def test_a_shape_has_the_given_axes(tmp_path):
    shape = {"semi_axes_mm": (10.0, 13.0, 8.0), "edge_length_mm": 1.6}
    run_script("shape.py", tmp_path, {}, {0: "shape.gii"}, {"shape": shape})


def test_an_export_has_the_tables_of_the_study_and_covariates_as_they_are(tmp_path):
    paths = {}
    for side in SIDES:
        write_surface(tmp_path / f"{side}.gii", sphere(10.0, 2))
        write_vertex_maps(
            tmp_path / f"{side}.shape.gii", {"thickness_mm": np.ones(162)}
        )
        paths[side] = str(tmp_path / side)
    write_json(tmp_path / "surface.json", {"pose": Pose().plain()})
    files = {
        kind: {side: path + end for side, path in paths.items()}
        for kind, end in (("surfaces", ".gii"), ("maps", ".shape.gii"))
    }
    report = str(tmp_path / "surface.json")
    brain = ExportedBrain(
        "a", "observed", 22.5, "a", **files, regions={}, report=report, covariates={}
    )
    brains = [brain._replace(covariates={"field": "07"})]
    brains.append(brain._replace(brain="b", subject="b", covariates={"field": "1.50"}))
    common = {"run": "observed", "week": 22.5, "hemisphere": "whole", "region": ""}
    common |= {"metric": "area", "unit": "cm2", "value": [90.5, 95.5]}
    long = pd.DataFrame({"subject": ["a", "b"]} | common)
    write_table(tmp_path / "long.csv", long)
    (tmp_path / "export").mkdir()
    inputs, outputs = {"long": "long.csv"}, {0: "export/dataset_description.json"}
    run_script("export.py", tmp_path, inputs, outputs, {"brains": brains})
    wide = (tmp_path / "export" / "metrics_wide.tsv").read_text().splitlines()
    assert [line.split("\t")[-2:] for line in wide] == [
        ["field", "whole_area_cm2"],
        ["07", "90.5"],
        ["1.50", "95.5"],
    ]
    described = read_json(tmp_path / "export" / "metrics_wide.json")
    assert described["whole_area_cm2"]["Units"] == "cm^2"
    assert (tmp_path / "export" / "metrics_long.tsv").exists()
    assert not (tmp_path / "export" / "metrics_wide.csv").exists()


@ALL_OUTPUTS
def test_a_file_is_fetched_only_with_its_checksum(tmp_path, monkeypatch):
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr(downloads, "TRIES", 1)
    content = gifti()
    with serving(Server({"left.gii": content})) as server:
        params = {"url": f"{server.url}/left.gii", "sha256": sha256(content)}
        run_script("retrieve.py", tmp_path, {}, {0: "left.gii"}, params)
        assert (tmp_path / "left.gii").read_bytes() == content
        params["sha256"] = sha256(b"another")
        with pytest.raises(SystemExit, match="5"):
            run_script("retrieve.py", tmp_path, {}, {0: "new.gii"}, params)
        assert not (tmp_path / "new.gii").exists()
