"""Scripts that carry something between two brains: each brain in its own pose, far from
the origin and turned.

Correspondences lead from the files of one brain to those of the other, or from a posed
brain where its labels are made from its surfaces. A script that takes another brain's
pose, or a motion for its inverse, is off by 300 mm.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from scripts import run_script
from shapes import FAR, ellipsoid, ellipsoid_mesh, hemisphere, rigid, scaling

from gyriflow.geometry.deformations import (
    Deformation,
    between_moved,
    carry,
    transform_points,
)
from gyriflow.geometry.poses import Pose
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_surface
from gyriflow.geometry.triangles import (
    TriangleMesh,
    corners,
    merged,
    submesh,
    transformed,
)
from gyriflow.io import origins
from gyriflow.io.files import write_json
from gyriflow.io.registrations import (
    WeeklyShapes,
    read_correspondence,
    read_path_key,
    read_weekly_shapes,
    stored_name,
    write_correspondence,
    write_weekly_shapes,
)
from gyriflow.io.surfaces import (
    read_vertex_labels,
    read_vertex_maps,
    write_surface,
    write_vertex_labels,
    write_vertex_maps,
)
from gyriflow.io.tetmeshes import Regions, write_regions, write_tetrahedral_mesh
from gyriflow.io.volumes import LabelSource, LabelVolume, write_label_volume
from gyriflow.settings.ensemble import Variation
from gyriflow.settings.schemes import LabelScheme
from gyriflow.settings.terms import LEFT, RIGHT, SIDES

pytestmark = pytest.mark.usefixtures("recorded_outputs")
FIRST, SECOND = (Pose(world) for world in FAR)
GROWN = rigid(5.0, -4.0, 8.0, shift=(6.0, -3.0, 2.0)) @ scaling(1.1)
"""From the files of the first brain to those of the second: larger and turned a
little."""
NAMES = {1: "a", 2: "b", 3: "c", 4: "d"}
WHETHER_POSED = pytest.mark.parametrize("posed", [(True, False), (False, True)])


def write_pair(folder, name, matrix, worlds, posed) -> None:
    """Write the affine correspondence of two brains, from and to the posed ones if
    so."""
    first, second = (
        world if is_posed else np.eye(4)
        for world, is_posed in zip(worlds, posed, strict=True)
    )
    affine = Deformation(matrix, np.zeros((21, 21, 21, 3)), scaling(6.0, -60.0))
    write_correspondence(folder / name, between_moved(affine, first, second), {})


def write_brains(folder, posed) -> dict[str, dict[str, TriangleMesh]]:
    """Write the hemispheres of two posed brains, their poses, and what leads from one
    to the other.

    Return their hemispheres by brain and side in the coordinates of their files.
    """
    brains = {}
    for name, pose, grown in (("first", FIRST, np.eye(4)), ("second", SECOND, GROWN)):
        brains[name] = {
            side: transformed(hemisphere(sign), grown)
            for side, sign in zip(SIDES, (-1, 1), strict=True)
        }
        write_json(folder / f"{name}.json", {"pose": pose.plain()})
        for side, mesh in brains[name].items():
            write_surface(folder / f"{name}.{side}.gii", transformed(mesh, pose.world))
    write_pair(folder, "between.h5", GROWN, FAR, posed)
    return brains


def front(mesh: TriangleMesh) -> np.ndarray:
    """Return the regions of a hemisphere of the first brain: in front of y = 2 mm, and
    behind."""
    return np.where(mesh.vertices[:, 1] > 2.0, 1, 2)


@WHETHER_POSED
def test_regions_are_carried_from_the_brain_on_which_they_are_given(tmp_path, posed):
    brains = write_brains(tmp_path, posed=posed)
    inputs = {"given_report": "first.json", "report": "second.json"}
    inputs["correspondence"] = "between.h5"
    for side, mesh in brains["first"].items():
        # another number on the right, so that no side stands for the other
        labels = front(mesh) + 2 * (side == "right")
        write_vertex_labels(tmp_path / f"{side}.label.gii", labels, NAMES)
        inputs |= {f"given_{side}": f"first.{side}.gii", side: f"second.{side}.gii"}
        inputs[f"{side}_regions"] = f"{side}.label.gii"
    outputs = {f"{side}_regions": f"found.{side}.label.gii" for side in SIDES}
    run_script("carried_regions.py", tmp_path, inputs, outputs, {"posed": posed})
    for side, mesh in brains["first"].items():
        found, _ = read_vertex_labels(tmp_path / f"found.{side}.label.gii")
        assert (found == front(mesh) + 2 * (side == "right")).mean() > 0.98


@pytest.mark.parametrize("source", ["volume", "surfaces"])
def test_regions_are_given_in_the_coordinates_of_the_files(tmp_path, source):
    """Each surface file has a pose of its own, and other numbers for its regions."""
    sides = {"left": hemisphere(-1), "right": hemisphere(1)}
    poses = {"left": FAR[1], "right": FAR[1] @ FAR[0]}
    write_json(tmp_path / "report.json", {"pose": Pose(FAR[0], poses).plain()})
    inputs = {"report": "report.json"}
    params = {"names": {}, "affine_from": "auto"}
    for side, mesh in sides.items():
        write_surface(tmp_path / f"{side}.gii", mesh)
        inputs[side] = f"{side}.gii"
    if source == "volume":
        affine = scaling((1.2, 1.0, 1.4), (-27.0, -28.0, -20.0))
        shape = (46, 57, 30)
        x, y, z = transform_points(np.indices(shape).reshape(3, -1).T, affine).T
        inside = (np.abs(x) < 26) & (np.abs(z) < 18)
        labels = np.where(inside, np.where(y > 2.0, 9, 4), 0).reshape(shape)
        volume = LabelVolume(labels, np.linalg.inv(FAR[0]) @ affine)
        write_label_volume(tmp_path / "regions.nii.gz", volume)
        inputs["volume"] = "regions.nii.gz"
        params["names"] = {9: "front", 4: "back"}
    else:
        for number, (side, mesh) in enumerate(sides.items()):
            own = transformed(mesh, np.linalg.inv(poses[side]))
            write_surface(tmp_path / f"{side}.own.gii", own)
            names = {5: ("front", "back")[number], 6: ("back", "front")[number]}
            is_front = mesh.vertices[:, 1] > 2.0
            labels = np.where(is_front == (number == 0), 5, 6)
            write_vertex_labels(tmp_path / f"{side}.label.gii", labels, names)
            inputs |= {f"{side}_labels": f"{side}.label.gii"}
            inputs |= {f"{side}_surface": f"{side}.own.gii"}
    outputs = {f"{side}_regions": f"{side}.found.gii" for side in SIDES}
    run_script("given_regions.py", tmp_path, inputs, outputs, params)
    for side, mesh in sides.items():
        found, names = read_vertex_labels(tmp_path / f"{side}.found.gii", side)
        assert set(names.values()) == {"front", "back"}
        y = mesh.vertices[:, 1]
        clear = np.abs(y - 2.0) > 0.8
        words = np.array([names[number] for number in found[clear].tolist()])
        assert (words == np.where(y[clear] > 2.0, "front", "back")).all()


@WHETHER_POSED
def test_maps_come_to_the_template_from_the_brain(tmp_path, posed):
    brains = write_brains(tmp_path, posed=posed)
    x = brains["first"]["right"].vertices[:, 0]
    write_vertex_maps(tmp_path / "maps.gii", {"x": x})
    # the template is the first brain, in other triangles
    template = ellipsoid([11.0, 24.0, 16.0], 3, centre=(12.5, 0.0, 0.0))
    write_surface(tmp_path / "template.gii", transformed(template, FIRST.world))
    inputs = {"template": "template.gii", "template_report": "first.json"}
    inputs |= {"surface": "second.right.gii", "report": "second.json"}
    inputs |= {"maps": "maps.gii", "correspondence": ["between.h5"]}
    job = {"params": {"posed": posed}, "wildcards": SimpleNamespace(side="right")}
    run_script("template_maps.py", tmp_path, inputs, {0: "found.gii"}, **job)
    found = read_vertex_maps(tmp_path / "found.gii")
    assert found["x"] == pytest.approx(template.vertices[:, 0], abs=0.1)
    assert found["template_distance_mm"].max() < 0.3
    # of the template itself nothing is carried
    del inputs["correspondence"]
    inputs |= {"template": "second.right.gii", "template_report": "second.json"}
    run_script("template_maps.py", tmp_path, inputs, {0: "found.gii"}, **job)
    assert read_vertex_maps(tmp_path / "found.gii")["x"] == pytest.approx(x)


def test_matched_surfaces_correspond_in_the_coordinates_of_the_files(tmp_path):
    """Each hemisphere of each brain has a pose of its own, and none is that of the
    brain's volumes."""
    halves = {"left": hemisphere(-1), "right": hemisphere(1)}
    brains = []
    for number, world in enumerate(FAR):
        grown = scaling(1.0 + 0.1 * number)
        poses = {
            "left": rigid(0, 20 + number, 0, shift=(9.0, 0.0, 0.0)),
            "right": rigid(0, 0, 40, shift=(0.0, -7.0, number)),
        }
        write_json(tmp_path / f"{number}.json", {"pose": Pose(world, poses).plain()})
        for side, mesh in halves.items():
            in_file = transformed(transformed(mesh, grown), np.linalg.inv(poses[side]))
            write_surface(tmp_path / f"{number}.{side}.gii", in_file)
        whole = merged(*halves.values())
        brains.append(transformed(whole, np.linalg.inv(world) @ grown))
    files = [
        [str(tmp_path / f"{number}.{side}.gii") for side in SIDES] for number in (0, 1)
    ]
    inputs = {"reports": ["0.json", "1.json"]}
    outputs, params = {0: "found.h5"}, {"files": files}
    run_script("match_surfaces.py", tmp_path, inputs, outputs, params)
    found = read_correspondence(tmp_path / "found.h5")
    assert found.first.vertices == pytest.approx(brains[0].vertices, abs=1e-3)
    assert found.second == pytest.approx(brains[1].vertices, abs=1e-3)


SCHEME = LabelScheme(name="ball", cerebrum=(1, 2), cortex=(2,))


def write_ball(path, semi_axes, centre, spacing_mm=2.0) -> LabelSource:
    """Write the labels of an ellipsoid with a cortex of 3 mm, in voxels whose axes are
    stored in another order."""
    low = np.asarray(centre) - np.max(semi_axes) - 8.0
    shape = np.full(3, int((2 * np.max(semi_axes) + 16.0) / spacing_mm))
    affine = scaling(spacing_mm, low)[:, [1, 2, 0, 3]]
    points = transform_points(np.indices(shape).reshape(3, -1).T, affine) - centre
    radius = np.linalg.norm(points / semi_axes, axis=1).reshape(shape)
    labels = np.where(radius < 1.0, np.where(radius < 0.85, 1, 2), 0)
    write_label_volume(path, LabelVolume(labels.astype(np.int32), affine))
    return LabelSource(str(path), "auto", SCHEME)


def test_a_registration_leads_from_the_earlier_brain_to_the_later_one(tmp_path):
    small, large = (14.0, 20.0, 16.0), (16.0, 23.0, 18.0)
    at, later_at = np.array([120.0, -200.0, 150.0]), np.array([110.0, -190.0, 155.0])
    sources = [
        write_ball(tmp_path / "a.nii.gz", small, at),
        write_ball(tmp_path / "b.nii.gz", large, later_at),
    ]
    params = {"brains": sources, "images": [None, None]}
    params |= {"seed": 0, "smoothing": 1.0, "is_varied": False}
    inputs, outputs = {"brains": ["a.nii.gz", "b.nii.gz"]}, {0: "found.h5"}
    job = {"threads": 1, "wildcards": SimpleNamespace(earlier="a", later="b")}
    run_script("register.py", tmp_path, inputs, outputs, params, **job)
    found = read_correspondence(tmp_path / "found.h5")
    ball = ellipsoid(small, 3, centre=at)
    radius = np.linalg.norm((carry(found, ball.vertices) - later_at) / large, axis=1)
    assert radius.mean() == pytest.approx(1.0, abs=0.03)
    assert carry(found, at[None])[0] == pytest.approx(later_at, abs=1.0)


def test_a_series_is_followed_through_the_poses_of_its_brains(tmp_path, monkeypatch):
    monkeypatch.setattr(origins, "present_key", lambda origin: f"key-of-{origin}")
    worlds = [*FAR, FAR[1] @ FAR[0]]
    mesh = ellipsoid_mesh(5, (14.0, 20.0, 16.0))
    boundary, used = boundary_surface(mesh)
    shapes = []
    for number, (world, factor) in enumerate(zip(worlds, (1, 1.04, 1.08), strict=True)):
        shapes.append(transform_points(factor * mesh.vertices, world))
        write_json(tmp_path / f"{number}.json", {"pose": Pose(world).plain()})
        surface = TriangleMesh(shapes[-1][used], boundary.faces)
        write_surface(tmp_path / f"{number}.gii", surface)
    start = TetrahedralMesh(shapes[0], mesh.tets)
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", start)
    # the first pair leads from the files, the second from the posed second brain to the
    # files of the third
    posed = [(False, False), (True, False)]
    write_pair(tmp_path, "a.h5", scaling(1.04), worlds[:2], posed[0])
    write_pair(tmp_path, "b.h5", scaling(1.08 / 1.04), worlds[1:], posed[1])
    inputs = {"mesh": "mesh.xdmf", "data": "mesh.h5", "report": "0.json"}
    inputs |= {"reports": ["1.json", "2.json"], "surfaces": ["1.gii", "2.gii"]}
    inputs |= {"correspondences": ["a.h5", "b.h5"]}
    params = {"weeks": [21.0, 22.0, 23.0], "posed": posed, "open_sulci": False}
    params |= {"code": "", "origin": "atlas", "store": str(tmp_path)}
    job = {"wildcards": SimpleNamespace(brain="first")}
    run_script("targets.py", tmp_path, inputs, {0: "targets.h5"}, params, **job)
    found = read_weekly_shapes(tmp_path / "targets.h5")
    assert found.weeks.tolist() == [21.0, 22.0, 23.0]
    for places, expected in zip(found.positions, shapes, strict=True):
        assert np.linalg.norm(places - expected, axis=1).max() < 0.5
    # the path is kept for other studies, which ask what it was made from
    assert read_path_key(tmp_path / "targets.h5") == "key-of-atlas"
    kept = read_weekly_shapes(tmp_path / stored_name("first", "key-of-atlas"))
    assert kept.positions == pytest.approx(found.positions)


@WHETHER_POSED
def test_a_brain_is_predicted_from_its_place_in_the_atlas(tmp_path, posed):
    """The brain is the atlas' of 22 GW, and grows as it does: by 4 % a week."""
    atlas = ellipsoid_mesh(6, (14.0, 20.0, 16.0))
    brain = ellipsoid_mesh(5, (14.0, 20.0, 16.0))
    weeks = np.array([21.0, 22.0, 23.0, 24.0, 25.0])
    sizes = 1.04 ** (weeks - 22.0)
    positions = [transform_points(size * atlas.vertices, FAR[1]) for size in sizes]
    path = WeeklyShapes(weeks, np.stack(positions), tets=atlas.tets)
    write_weekly_shapes(tmp_path / "path.h5", path)
    start = TetrahedralMesh(transform_points(brain.vertices, FAR[0]), brain.tets)
    write_tetrahedral_mesh(tmp_path / "mesh.xdmf", start)
    for name, world in zip(("brain", "atlas"), FAR, strict=True):
        write_json(tmp_path / f"{name}.json", {"pose": Pose(world).plain()})
    write_pair(tmp_path, "pair.h5", np.eye(4), FAR, posed)
    inputs = {"mesh": "mesh.xdmf", "path": "path.h5", "norms": None, "volumes": None}
    inputs |= {"reports": ["brain.json", "atlas.json"], "correspondence": ["pair.h5"]}
    params = {"start_week": 22.0, "end_week": 23.0, "atlas_week": 22.0}
    params |= {"posed": posed, "further_weeks": [], "open_sulci": False}
    params |= {"variation": None, "left_out": ["crl"]}
    run_script("predicted_targets.py", tmp_path, inputs, {0: "found.h5"}, params)
    found = read_weekly_shapes(tmp_path / "found.h5")
    assert found.weeks.tolist() == [22.0, 23.0, 24.0]
    assert found.positions[0] == pytest.approx(start.vertices, abs=1e-3)
    # on all brains of the atlas
    assert list(found.placed) == [21.0, 22.0, 23.0, 24.0, 25.0]
    volumes = found.sizes["volume_ml"]
    expected = 1.04 ** (3 * (found.weeks - 22.0))
    assert volumes / volumes[0] == pytest.approx(expected, rel=0.01)
    if posed == (True, False):
        # a member: older than stated, so it grows as one of the atlas half a week later
        scales = {"difference_smoothing_mm": 8.0, "fading_gw": 4.0, "lasting": 0.5}
        params["variation"] = Variation(0, 1, 1.0, age_shift_gw=0.5, **scales)
        run_script("predicted_targets.py", tmp_path, inputs, {0: "found.h5"}, params)
        found = read_weekly_shapes(tmp_path / "found.h5")
        assert found.weeks.tolist() == [22.0, 22.5, 23.5, 24.5]


def test_regions_move_with_the_tissue_of_their_own_side(tmp_path):
    mesh = ellipsoid_mesh(12, (16.0, 20.0, 15.0))
    surface, used = boundary_surface(mesh)
    facets = used[surface.faces]
    x = mesh.vertices[facets][:, :, 0].mean(axis=1)
    side_of_facet = np.where(x < 0, LEFT, RIGHT)
    fields = {"growing": np.ones(len(mesh.vertices))}
    cell_tags = {"zone": np.ones(len(mesh.tets), dtype=np.int32)}
    regions = Regions(mesh, facets, fields, cell_tags, {"hemisphere": side_of_facet})
    write_regions(tmp_path / "regions.xdmf", regions)
    inputs = {"mesh": "regions.xdmf"}
    for side, tag in (("left", LEFT), ("right", RIGHT)):
        # the measured surface has triangles of its own; regions by height, numbered by
        # side
        measured = ellipsoid((16.0, 20.0, 15.0), 4)
        is_left = corners(measured)[:, :, 0].mean(axis=1) < 0
        part, _ = submesh(measured, is_left == (tag == LEFT))
        write_surface(tmp_path / f"{side}.gii", part)
        regions = np.where(part.vertices[:, 2] > 0, 1, 2) + 2 * (side == "right")
        write_vertex_labels(tmp_path / f"{side}.label.gii", regions, NAMES)
        inputs |= {side: f"{side}.gii", f"{side}_regions": f"{side}.label.gii"}
    outputs = {f"{side}_regions": f"found.{side}.label.gii" for side in SIDES}
    run_script("simulated_regions.py", tmp_path, inputs, outputs)
    for side, more in (("left", 0), ("right", 2)):
        found, _ = read_vertex_labels(tmp_path / f"found.{side}.label.gii")
        kept = np.unique(facets[side_of_facet == (LEFT if side == "left" else RIGHT)])
        z = mesh.vertices[kept, 2]
        clear = np.abs(z) > 1.5
        assert np.array_equal(found[clear], np.where(z[clear] > 0, 1, 2) + more)
