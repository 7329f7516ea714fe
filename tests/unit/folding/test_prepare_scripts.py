"""What the scripts that prepare runs write: parameters, and maps on the mesh where they
lie in the brain's own pose."""

from types import SimpleNamespace

import nibabel as nib
import numpy as np
import pandas as pd
import pytest
from ellipsoid import CENTRE_MM, RUN, brain_mesh
from scripts import run_script
from shapes import FAR, LONG_MM, scaling

from gyriflow.folding.layers import PialSearch, cortical_weight
from gyriflow.folding.zones import zones_of_run
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.tetrahedra import boundary_surface
from gyriflow.geometry.triangles import corners, submesh, transformed
from gyriflow.io.files import write_json, write_table
from gyriflow.io.registrations import WeeklyShapes, write_weekly_shapes
from gyriflow.io.surfaces import write_surface, write_vertex_maps
from gyriflow.io.tetmeshes import read_maps, read_regions, write_tetrahedral_mesh
from gyriflow.io.yaml_files import read_yaml, write_yaml
from gyriflow.settings.folding import parameters_from

MESH = brain_mesh(8)
POSED = {"mesh": "mesh.xdmf", "data": "mesh.h5", "sides": ["left.gii", "right.gii"]}
SETTINGS = {
    key: value
    for key, value in RUN.items()
    if key not in ("start_week", "output_weeks", "fissure_x_mm")
}
SLOPE = np.array([0.01, -0.02, 0.015])


def thickness_at(points):
    """Return a thickness in mm that is linear in the coordinates of the mesh."""
    return 2.5 + (points - CENTRE_MM) @ SLOPE


pytestmark = pytest.mark.usefixtures("recorded_outputs")


@pytest.fixture
def folder(tmp_path):
    """A folder with the mesh of a brain, its hemispheres, and the pose that it was
    brought from."""
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", MESH)
    surface, _ = boundary_surface(MESH)
    on_left = corners(surface).mean(axis=1)[:, 0] < CENTRE_MM[0]
    for side, faces in (("left", on_left), ("right", ~on_left)):
        write_surface(tmp_path / f"{side}.gii", submesh(surface, faces)[0])
    report = {"fissure_x_mm": CENTRE_MM[0], "pose": Pose(FAR[0]).plain()}
    write_json(tmp_path / "surface.json", report)
    return tmp_path


def prepared(folder, maps=None, settings=None, **inputs):
    """Run the script that prepares a run, and return its parameters and maps."""
    files = {"surface": "surface.json", "curves": None, "targets": None}
    outputs = {"params": "params.yaml", "maps": "maps.h5", "regions": "regions.xdmf"}
    params = {
        "settings": SETTINGS | {"growth": {"model": "rates"}} | (settings or {}),
        "weeks": [21.0, 22.0],
        "series": None,
        "affine_from": "auto",
        "maps": maps or {},
    }
    run_script("prepare.py", folder, POSED | files | inputs, outputs, params)
    found = read_maps(folder / "maps.h5") if (folder / "maps.h5").exists() else {}
    return read_yaml(folder / "params.yaml"), found


def weight_for(parameters, thickness_mm):
    """Return the cortical weight at the vertices of the mesh for a thickness."""
    zones = zones_of_run(MESH, parameters_from(parameters))
    pial = PialSearch(MESH.vertices, zones.cortex_facets)
    distance_mm, _ = pial.nearest(MESH.vertices)
    return cortical_weight(distance_mm, thickness_mm)


def source(folder, file, surface=None):
    surfaces = [str(folder / surface)] if surface else []
    return {"map": [str(folder / file)], "surface": surfaces, "curve": 1.0}


@pytest.mark.parametrize("kind", ["volume", "surface"])
def test_a_map_in_the_file_s_coordinates_is_moved_to_the_mesh(folder, kind):
    back = np.linalg.inv(FAR[0])
    if kind == "volume":
        shape = (100, 80, 60)
        affine = back @ scaling(LONG_MM)
        affine[:3, 3] += (back @ [*CENTRE_MM, 1.0])[:3] - affine[:3, 3]
        affine[:3, 3] -= affine[:3, :3] @ (np.array(shape) / 2)
        index = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
        points = transform_points(index.reshape(-1, 3), FAR[0] @ affine)
        values = thickness_at(points).reshape(shape).astype(np.float32)
        image = nib.Nifti1Image(values, affine)
        image.header.set_xyzt_units("mm")
        nib.save(image, folder / "map.nii.gz")
        maps = {"thickness_mm": source(folder, "map.nii.gz")}
    else:
        surface, _ = boundary_surface(MESH)
        write_surface(folder / "given.gii", transformed(surface, back))
        values = {"thickness_mm": thickness_at(surface.vertices)}
        write_vertex_maps(folder / "map.gii", values)
        maps = {"thickness_mm": source(folder, "map.gii", "given.gii")}
    settings = {"thickness_mm": {"map": "thickness_mm"}}
    parameters, found = prepared(folder, maps, settings)
    used = boundary_surface(MESH)[1]
    expected = thickness_at(MESH.vertices)
    assert found["thickness_mm"][used] == pytest.approx(expected[used], abs=1e-4)
    # the fields of the first step are made with it
    regions = read_regions(folder / "regions.xdmf")
    weight = weight_for(parameters, found["thickness_mm"])
    assert regions.fields["cortex_weight"] == pytest.approx(weight, abs=1e-4)


def test_targets_are_the_weeks_that_the_path_passes_and_their_sizes(folder):
    weeks = np.array([21.0, 21.5, 22.0, 23.0])
    factors = np.array([1.0, 1.04, 1.1, 1.2])
    positions = np.stack([factor * MESH.vertices for factor in factors])
    sizes = {"area_cm2": 80 * factors**2, "volume_ml": 40 * factors**3}
    shapes = WeeklyShapes(weeks, positions, sizes, stops=[22.0], between=[21.5])
    write_weekly_shapes(folder / "targets.h5", shapes)
    growth = {"model": "shapes", "of": "self"}
    settings = {"growth": growth, "contact": "none", "support": "free"}
    parameters, maps = prepared(folder, settings=settings, targets="targets.h5")
    assert list(parameters["targets"]) == parameters["stops"] + [23.0] == [22.0, 23.0]
    for week, factor in ((22.0, 1.1), (23.0, 1.2)):
        name = parameters["targets"][week]
        found = np.stack([maps[f"{name}_{axis}"] for axis in "xyz"], axis=1)
        assert found == pytest.approx(factor * MESH.vertices)


def test_a_run_of_a_round_is_the_base_run_with_the_values_of_its_row(folder):
    base = RUN | {"end_week": 24.0, "output_weeks": [21.0, 23.0, 24.0]}
    write_yaml(folder / "base.yaml", base | {"shear_modulus_core_pa": 200.0})
    design = pd.DataFrame({"run": ["r1", "r2"], "thickness_mm": [1.5, 3.0]})
    design["shear_modulus_cortex_pa"] = [200.0, 400.0]
    write_table(folder / "design.csv", design)
    inputs = POSED | {"design": "design.csv", "base": "base.yaml", "maps": None}
    outputs = {"params": "params.yaml", "regions": "regions.xdmf"}
    wildcards = SimpleNamespace(run="r2")
    params = {"week": 22.5}
    script = "prepare_calibrated.py"
    run_script(script, folder, inputs, outputs, params, wildcards=wildcards)
    parameters = read_yaml(folder / "params.yaml")
    assert parameters["thickness_mm"] == 3.0
    assert (parameters["end_week"], parameters["output_weeks"]) == (22.5, [21.0, 22.5])
    regions = read_regions(folder / "regions.xdmf")
    expected = weight_for(parameters, 3.0)
    assert regions.fields["cortex_weight"] == pytest.approx(expected, abs=1e-6)
