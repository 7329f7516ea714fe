"""Hemispheres of a folded brain whose fissure is bent: those of the measured brain,
carried along by the scripts."""

import numpy as np
import pytest
from ellipsoid import CENTRE_MM, RUN, SEMI_AXES, brain_mesh
from facts import Facts
from recording import contents
from scripts import run_script
from shapes import ellipsoid

from gyriflow.anatomy.fissure import nearer_left
from gyriflow.errors import InputError
from gyriflow.folding.start_regions import start_regions
from gyriflow.geometry.triangles import corners, submesh
from gyriflow.io.frames import join_frames, write_frame
from gyriflow.io.tetmeshes import read_regions, write_regions
from gyriflow.settings.folding import parameters_from
from gyriflow.settings.terms import LEFT, RIGHT


def beyond_fissure(points):
    """Return how far (n, 3) points are to the right of a fissure that swings by 4 mm to
    both sides."""
    x, y, _ = (points - CENTRE_MM).T
    return x - 4.0 * np.sin(y / 8.0)


def folded(points):
    """Return points where a folded brain could have them: larger, and all to the right
    of the start's fissure."""
    x, y, z = 1.3 * (points - CENTRE_MM).T
    return np.column_stack([x + 40.0 + 0.006 * y**2, y, z]) + CENTRE_MM


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with the regions of the brain's mesh, and with the surfaces of its
    second frame."""
    folder = tmp_path_factory.mktemp("folded")
    brain = brain_mesh(10)
    # the measured brain, in triangles of its own
    surface = ellipsoid(SEMI_AXES, 4, CENTRE_MM)
    on_left = beyond_fissure(corners(surface).mean(axis=1)) < 0
    left, right = (submesh(surface, faces)[0] for faces in (on_left, ~on_left))

    def left_faces(mesh):
        return nearer_left(mesh, left, right)

    write_regions(
        folder / "regions.xdmf",
        start_regions(brain, parameters_from(RUN), {}, left_faces),
    )
    for week, positions in ((21.0, brain.vertices), (22.0, folded(brain.vertices))):
        write_frame(folder / f"{week}.h5", week, {"positions": positions})
    join_frames(
        folder / "frames.h5", brain.tets, [folder / "21.0.h5", folder / "22.0.h5"]
    )
    parts = {
        part: f"{part}.gii"
        for part in ("whole", "left", "right", "thickness", "left_maps", "right_maps")
    }
    tables = {table: f"{table}.csv" for table in ("metrics", "spectra", "coefficients")}
    frames = {"frames": "frames.h5", "regions": "regions.xdmf"}
    params = {
        "columns": {"subject": "a", "run": "r", "week": 22.0},
        "settings": {"curvature_radius_mm": 8.0, "spangy_modes": 30},
    }
    run_script("measure.py", folder, frames, parts | tables, params)
    return folder


BRAIN = brain_mesh(6)


@pytest.mark.parametrize("maps", [{}, {"thickness_mm": np.zeros(len(BRAIN.vertices))}])
def test_regions_of_a_start_need_its_maps_within_their_bounds(maps):
    p = parameters_from(RUN | {"thickness_mm": {"map": "thickness_mm"}})
    with pytest.raises(InputError, check=Facts("thickness_mm")):
        start_regions(BRAIN, p, maps, lambda mesh: mesh.faces[:, 0] >= 0)


def test_facets_have_the_hemisphere_that_they_lie_on_though_the_fissure_is_bent(made):
    regions = read_regions(made / "regions.xdmf")
    centres = regions.mesh.vertices[regions.facets].mean(axis=1)
    beyond, tag = beyond_fissure(centres), regions.facet_tags["hemisphere"]
    clear = np.abs(beyond) > 0.5
    np.testing.assert_array_equal(tag[clear], np.where(beyond[clear] < 0, LEFT, RIGHT))
    # a plane would give some to the other side
    assert np.mean(tag != np.where(centres[:, 0] < CENTRE_MM[0], LEFT, RIGHT)) > 0.04


def test_numbers_of_the_folded_brain(made, recorded):
    files = sorted(made.glob("*.gii")) + sorted(made.glob("*.csv"))
    recorded({path.name: contents(path) for path in files}, rtol=1e-3)
