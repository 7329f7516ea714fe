"""Whole pial surfaces from each kind of input: closed spheres, posed, honest in size,
split at the fissure."""

import json
import os
from pathlib import Path

import numpy as np
import odd_brains
import pytest
import shapes
from atlas_brains import atlas_halves
from facts import Facts
from phantoms import CENTRE_MM
from scripts import run_script
from shapes import LPS, rigid, scaling, sphere

from gyriflow.anatomy.fissure import cut_share, smallest_gap, split
from gyriflow.anatomy.pial import from_hemispheres, from_labels, from_surface
from gyriflow.anatomy.plausible import (
    max_cut_share,
    require_whole,
)
from gyriflow.anatomy.repair import pieces
from gyriflow.errors import InputError, MeshError
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.poses import pose_from
from gyriflow.geometry.remeshing import self_intersecting_faces
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    euler_number,
    flipped,
    is_closed,
    mean_edge_length,
    merged,
    signed_volume,
    submesh,
    transformed,
)
from gyriflow.io.surfaces import read_surface, write_surface
from gyriflow.io.volumes import LabelSource, read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.mesh.maps import move_to_mesh
from gyriflow.metrics.measure import measure_brain
from gyriflow.settings.terms import SIDES
from gyriflow.shipped import SHIPPED

DATA = Path(
    os.environ.get("GYRIFLOW_DATA", Path(__file__).parents[4] / "shared" / "data")
)
ATLAS = SCHEMES["spina-bifida-atlas"]
VOXEL_MM = 1.6
QUICK = {"edge_length_mm": 2.0}
COARSE = {"week": 24.0, "edge_length_mm": 3.0}
pytestmark = pytest.mark.usefixtures("few_starts", "quick_poses")


@pytest.fixture(scope="module")
def volume():
    return shapes.phantom(24.0, VOXEL_MM)


@pytest.fixture(scope="module")
def phantom(volume):
    return from_labels(*volume, ATLAS, week=24.0, **QUICK)


@pytest.fixture(scope="module")
def halves():
    """The phantom's left and right hemispheres as closed surfaces a millimetre apart,
    where its volume has them."""
    return [
        transformed(half, rigid(shift=CENTRE_MM))
        for half in shapes.phantom_halves(24.0, VOXEL_MM)
    ]


def require_sound(surface, surfaces=1):
    whole = surface.whole
    assert is_closed(whole)
    assert [euler_number(piece) for piece in pieces(whole)] == [2] * surfaces
    assert all(signed_volume(piece) > 0 for piece in pieces(whole))
    assert not self_intersecting_faces(whole).any()
    assert len(surface.left.faces) + len(surface.right.faces) == len(whole.faces)
    assert (
        surface.left.vertices[:, 0].mean()
        < surface.fissure_x_mm
        < surface.right.vertices[:, 0].mean()
    )
    assert area(surface.left) + area(surface.right) == pytest.approx(area(whole))
    json.dumps(surface.report, allow_nan=False)


def test_phantom_surface_is_sound_and_of_the_masks_volume(phantom):
    require_sound(phantom)
    report = phantom.report
    expected = report["label_volumes_mL"]["cerebrum"] - report["fissure_opened_mL"]
    assert report["volume_mL"] == pytest.approx(expected, rel=0.015)
    assert report["volume_mL"] == pytest.approx(signed_volume(phantom.whole) / 1e3)
    assert phantom.fissure_x_mm == pytest.approx(CENTRE_MM[0], abs=0.4)
    assert report["rotation_deg"] < 1.0


def test_the_report_describes_the_surface_of_long_voxels():
    volume = shapes.phantom(24.0, (1.7, 2.0, 2.4))
    phantom = from_labels(*volume, ATLAS, week=24.0, **QUICK)
    report, whole = phantom.report, phantom.whole
    expected = {
        "source": "labels",
        "scheme": ATLAS.name,
        "week": 24.0,
        "fissure_x_mm": phantom.fissure_x_mm,
        "vertices": len(whole.vertices),
        "faces": len(whole.faces),
        "pieces": 1,
        "euler_number": 2,
        "usual_cut_share": max_cut_share(24.0),
        "cut_share": pytest.approx(cut_share(phantom.left, phantom.right)),
    }
    assert {name: report[name] for name in expected} == expected
    extents = whole.vertices.max(axis=0) - whole.vertices.min(axis=0)
    assert report["extents_mm"] == pytest.approx(extents.tolist())
    areas = {
        "whole": area(whole) / 100,
        "left": area(phantom.left) / 100,
        "right": area(phantom.right) / 100,
    }
    assert report["area_cm2"] == pytest.approx(areas)
    assert report["fissure_points"] > 100
    assert report["asymmetry_mm"] < 1.0
    smoothing = report["smoothing"]
    assert smoothing["volume_change"] == pytest.approx(0.0, abs=1e-3)
    change = signed_volume(whole) / 1e3 / smoothing["volume_expected_mL"] - 1
    assert smoothing["volume_change"] == pytest.approx(change, abs=1e-6)
    assert smoothing["terraces_moved_mm"] < smoothing["terraces_moved_most_mm"]
    assert pose_from(report["pose"]).plain() == phantom.pose.plain()


def test_unequal_sides_are_reported_with_their_numbers():
    small = shapes.ellipsoid((12.0, 24.0, 17.0), 3, (88.0, -50.0, 20.0))
    large = shapes.ellipsoid((14.5, 29.0, 20.0), 3, (116.0, -50.0, 20.0))
    surface = from_surface(merged(small, large), **COARSE)
    areas = surface.report["area_cm2"]
    assert areas["left"] == pytest.approx(area(small) / 100, rel=0.02)
    assert areas["right"] == pytest.approx(area(large) / 100, rel=0.02)
    percent = 100 * (areas["right"] / areas["left"] - 1)
    asymmetry = surface.report["asymmetry_mm"]
    assert asymmetry > 0.03 * surface.report["extents_mm"][0]
    assert surface.report["fissure_points"] > 0
    warnings = surface.report["warnings"]
    assert Facts("areas", f"{percent:.0f} %") in warnings
    assert Facts("mirror-symmetric", f"{asymmetry:.1f} mm") in warnings
    assert Facts("no fissure") not in warnings
    assert surface.fissure_x_mm == pytest.approx(100.8, abs=0.7)
    assert surface.report["pieces"] == 2


def test_oblique_affine_gives_the_same_areas_and_fissure(volume, phantom):
    labels, affine = volume
    oblique = rigid(20, -30, 10)
    turned = from_labels(labels, oblique @ affine, ATLAS, week=24.0, **QUICK)
    require_sound(turned)
    for part in ("whole", "left", "right"):
        assert turned.report["area_cm2"][part] == pytest.approx(
            phantom.report["area_cm2"][part], rel=0.005
        )
    assert Facts("cerebellum and brainstem") in turned.report["warnings"]
    normal = turned.pose.world[:3, :3] @ oblique[:3, 0]
    assert np.degrees(np.arccos(normal[0])) < 1.0


def test_the_fissure_is_where_the_brain_is_however_far_from_the_origin():
    """A tilt too small to be undone: at the origin, 300 mm away, the plane's x is
    another one by 2 mm."""
    brain = merged(*shapes.phantom_halves(21.0, 2.0))
    far = transformed(brain, rigid(0.0, 0.4, 0.0, shift=(20.0, -200.0, 220.0)))
    surface = from_surface(far, week=21.0, coordinates="ras", edge_length_mm=2.5)
    assert surface.report["rotation_deg"] == 0
    assert surface.fissure_x_mm == pytest.approx(20.0, abs=0.5)


def test_sulci_that_stay_fused_are_warned_of_at_ages_at_which_labels_close_them(volume):
    labels, affine = volume
    mask = np.isin(labels, ATLAS.cerebrum).astype(np.int32)
    for week, number in ((24.0, 0), (27.0, 1)):
        settings = COARSE | {"week": week, "open_sulci": True}
        surface = from_labels(mask, affine, SCHEMES["binary"], **settings)
        assert surface.report["sulci"] == {
            "stays_fused": "the labels have no white matter"
        }
        assert (
            len(
                [
                    warning
                    for warning in surface.report["warnings"]
                    if "not opened" in warning
                ]
            )
            == number
        )


def test_storage_order_makes_no_difference(volume, phantom):
    labels, affine = volume
    reversed_ = affine @ np.diag([1.0, -1.0, 1.0, 1.0])
    reversed_[:3, 3] += affine[:3, 1] * (labels.shape[1] - 1)
    same = from_labels(labels[:, ::-1], reversed_, ATLAS, week=24.0, **QUICK)
    assert same.report["area_cm2"]["whole"] == pytest.approx(
        phantom.report["area_cm2"]["whole"], rel=0.003
    )
    assert same.fissure_x_mm == pytest.approx(phantom.fissure_x_mm, abs=0.1)


@pytest.mark.parametrize(
    # with the wrong unit of a header that may give the same size, if any
    ("factor", "units"),
    [
        (1e-3, ["metres", "header says micrometres"]),
        (1e3, ["micrometres", "header says metres"]),
        (0.1, ["centimetres"]),
    ],
)
def test_wrong_unit_is_caught_and_named(volume, phantom, halves, factor, units):
    labels, affine = volume
    scale = np.diag([factor] * 3 + [1.0])
    facts = Facts(24, "mL", *units)
    with pytest.raises(InputError, check=facts):
        from_labels(labels, scale @ affine, ATLAS, week=24.0)
    with pytest.raises(InputError, check=facts):
        from_surface(transformed(phantom.whole, scale), week=24.0)
    with pytest.raises(InputError, check=facts):
        from_hemispheres(*(transformed(half, scale) for half in halves), week=24.0)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_two_brains_in_one_volume_or_surface_are_not_one_hemisphere(
    volume, phantom, axis
):
    labels, affine = volume
    facts = Facts("2 separate brains")
    with pytest.raises(InputError, check=facts):
        from_labels(
            np.concatenate([labels, labels], axis=axis),
            affine,
            ATLAS,
            week=24.0,
            **QUICK,
        )
    # in contact or nearly so, as in one uterus
    size = np.ptp(phantom.whole.vertices, axis=0)
    twins = merged(
        phantom.whole,
        transformed(phantom.whole, rigid(shift=1.02 * size * np.eye(3)[axis])),
    )
    with pytest.raises(InputError, check=facts):
        require_whole(twins, "surface")


def test_a_surface_in_voxel_indices_is_reported(phantom):
    assert Facts("%", 24) not in phantom.report["warnings"]
    # voxels of 0.7 mm
    indices = transformed(phantom.whole, np.diag([1 / 0.7] * 3 + [1.0]))
    surface = from_surface(indices, week=24.0, edge_length_mm=3.0)
    assert Facts("278 %", 24) in surface.report["warnings"]


def test_hemispheres_are_merged_apart_and_whole(halves):
    surface = from_hemispheres(*halves, week=24.0, **QUICK)
    require_sound(surface, surfaces=2)
    # in triangles of the length that is asked for
    assert mean_edge_length(surface.whole) == pytest.approx(2.0, rel=0.2)
    assert surface.report["moved_apart_mm"] == 0.0
    assert is_closed(surface.left)
    assert signed_volume(surface.whole) == pytest.approx(
        sum(map(signed_volume, halves)), rel=0.01
    )
    assert surface.fissure_x_mm == pytest.approx(CENTRE_MM[0], abs=0.4)
    assert smallest_gap(*pieces(surface.whole)) > 0.5


@pytest.mark.parametrize("coordinates", ["ras", "auto"])
def test_hemispheres_that_share_the_vertices_of_their_cut_are_joined_along_it(
    phantom, coordinates
):
    surface = from_hemispheres(
        phantom.left, phantom.right, week=24.0, coordinates=coordinates, **QUICK
    )
    require_sound(surface)
    assert (surface.report["source"], surface.report["joined_along_cut"]) == (
        "hemispheres",
        True,
    )
    assert signed_volume(surface.whole) == pytest.approx(
        signed_volume(phantom.whole), rel=0.01
    )
    assert area(surface.left) == pytest.approx(area(phantom.left), rel=0.03)
    with pytest.raises(InputError, check=Facts("left", "right", "RAS+")):
        from_hemispheres(
            phantom.right, phantom.left, week=24.0, coordinates=coordinates, **QUICK
        )


def test_the_files_of_hemispheres_are_the_left_and_the_right_one_in_turn(tmp_path):
    left, right, _ = shapes.cut_ellipsoid()
    write_surface(tmp_path / "lh.gii", left)
    write_surface(tmp_path / "rh.gii", right)
    inputs = {"given": ["lh.gii", "rh.gii"], "white": []}
    outputs = {name: f"{name}.gii" for name in ("whole", *SIDES)}
    outputs |= {"report": "report.json"}
    params = {
        "source": "hemispheres",
        "week": 24.0,
        "side": None,
        "labels": None,
        "coordinates": "ras",
        "checksums": {},
        "settings": QUICK,
        "limits": {},
    }
    run_script("pial.py", tmp_path, inputs, outputs, params)
    for name, given in zip(SIDES, (left, right), strict=True):
        found = read_surface(tmp_path / f"{name}.gii").vertices[:, 0]
        assert found.mean() == pytest.approx(given.vertices[:, 0].mean(), abs=1.5)


@pytest.mark.remeshed
@pytest.mark.usefixtures("recorded_outputs")
def test_labels_of_a_hemisphere_give_its_surface_and_thickness(tmp_path):
    labels, affine = shapes.phantom(24.0, (1.9, 2.1, 2.4))
    scheme = SCHEMES["dhcp-19"]
    sided = odd_brains.add_sides(labels, affine)
    left = odd_brains.one_hemisphere(sided, affine, "left")
    shapes.save_labels(tmp_path / "labels.nii.gz", left, shapes.FAR[0] @ affine)
    outputs = {name: f"{name}.gii" for name in ("whole", "left", "thickness")}
    outputs |= {"measured": "measured.gii", "report": "report.json"}
    outputs |= {"summary": "summary.json"}
    params = {
        "source": "labels",
        "week": 24.0,
        "side": "left",
        "labels": LabelSource(str(tmp_path / "labels.nii.gz"), "auto", scheme),
        "checksums": {},
        "settings": {"edge_length_mm": 3.0},
    }
    run_script("pial.py", tmp_path, {"given": [], "white": []}, outputs, params)
    surface = read_surface(tmp_path / "whole.gii")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["side"] == "left"
    # on the left of the mid-plane
    assert surface.vertices[:, 0].max() < report["fissure_x_mm"]
    mean_mm = json.loads((tmp_path / "summary.json").read_text())["mean_mm"]
    assert mean_mm == pytest.approx(2.0, abs=0.5)


def test_overlapping_hemispheres_are_moved_apart(halves):
    left = TriangleMesh(halves[0].vertices - [-2.5, 0, 0], halves[0].faces)
    surface = from_hemispheres(left, halves[1], week=24.0, **QUICK)
    require_sound(surface, surfaces=2)
    assert surface.report["gap_before_mm"] < 0
    assert 0.5 < surface.report["moved_apart_mm"] < 2.0
    assert smallest_gap(*pieces(surface.whole)) == pytest.approx(0.5, abs=0.1)
    assert (
        Facts(f"{surface.report['moved_apart_mm']:.2f} mm", "0.5 mm")
        in surface.report["warnings"]
    )
    # white surfaces and maps of either file follow its hemisphere
    for side, given in (("left", left), ("right", halves[1])):
        followed = transformed(given, surface.pose.of_file(side)).vertices
        assert np.quantile(nearest_on(followed, getattr(surface, side))[0], 0.95) < 0.4


@pytest.mark.slow
def test_maps_on_surfaces_in_lps_and_volumes_beside_them_lie_on_the_brain():
    halves = [
        shapes.moved(half, shift)
        for half, shift in zip(atlas_halves(), (-0.6, 0.6), strict=True)
    ]
    world = merged(*halves)
    sides, whole = [transformed(half, LPS) for half in halves], transformed(world, LPS)
    surfaces = {
        "pial, found": from_surface(
            whole, week=24.0, coordinates="auto", edge_length_mm=2.5
        ),
        "hemisphere, found": from_surface(
            sides[1], "right", week=24.0, coordinates="auto", edge_length_mm=2.5
        ),
        "hemispheres": from_hemispheres(
            *sides, week=24.0, coordinates="lps", edge_length_mm=2.5
        ),
    }
    for source, surface in surfaces.items():
        points, one = surface.whole.vertices, source.startswith("hemisphere,")
        given, there = (sides[1], halves[1]) if one else (whole, world)
        moved = move_to_mesh(points, given, surface.pose.of_file())
        # a volume knows the brain in the world, which is RAS+
        voxels = transformed(there, surface.pose.of_volume("a.nii"))
        for found in (moved, voxels):
            for end in (np.min, np.max):
                assert (
                    np.abs(end(found.vertices, axis=0) - end(points, axis=0)).max()
                    < 1.5
                ), source


def test_swapped_hemispheres_are_refused(halves):
    with pytest.raises(InputError, check=Facts("ras", 15.2, -6.5)):
        from_hemispheres(*reversed(halves), week=24.0)
    with pytest.raises(InputError, check=Facts("lps", 6.5, -15.2)):
        from_hemispheres(*halves, week=24.0, coordinates="lps")


@pytest.mark.parametrize(
    ("change", "bound"), [(scaling(1.06), "15 %"), (rigid(60, 0, 0), "1.3 mm")]
)
def test_hemispheres_of_different_weeks_and_in_different_poses_are_refused(
    halves, change, bound
):
    centre = halves[1].vertices.mean(axis=0)
    changed = transformed(
        halves[1], rigid(shift=centre) @ change @ rigid(shift=-centre)
    )
    with pytest.raises(InputError, check=Facts(bound, "surface.asymmetric")):
        from_hemispheres(halves[0], changed, week=24.0, **QUICK)


def test_pial_surface_with_a_small_hole_is_closed(phantom):
    # without one face
    holed, _ = submesh(phantom.whole, np.arange(len(phantom.whole.faces)) > 0)
    surface = from_surface(
        transformed(holed, LPS), week=24.0, coordinates="lps", **QUICK
    )
    require_sound(surface)
    assert surface.report["repair"]["holes_closed"] == 1
    assert surface.report["self_intersections"] == 0
    assert area(surface.whole) == pytest.approx(area(phantom.whole), rel=0.02)
    assert surface.fissure_x_mm == pytest.approx(phantom.fissure_x_mm, abs=0.2)


@pytest.mark.slow
def test_pial_surface_that_cuts_itself_is_made_anew(phantom):
    vertices = phantom.whole.vertices.copy()
    # the left hemisphere's medial wall pushed through the right one's
    wall = (np.abs(vertices[:, 0] - phantom.fissure_x_mm) < 3.0) & (
        vertices[:, 0] < phantom.fissure_x_mm
    )
    wall &= vertices[:, 2] > CENTRE_MM[2] + 10.0
    vertices[wall, 0] += 4.0
    tangled = TriangleMesh(vertices, phantom.whole.faces)
    assert self_intersecting_faces(tangled).sum() > 20
    surface = from_surface(tangled, week=24.0, **QUICK)
    require_sound(surface)
    assert signed_volume(surface.whole) == pytest.approx(
        signed_volume(tangled), rel=0.03
    )


@pytest.mark.parametrize("has_common_vertices", [True, False])
def test_hemispheres_that_share_their_medial_wall_in_one_file_are_moved_apart(
    has_common_vertices,
):
    *open_halves, wall = shapes.cut_ellipsoid()
    halves = [
        merged(half, side)
        for half, side in zip(open_halves, (wall, flipped(wall)), strict=True)
    ]
    vertices, places = np.unique(
        merged(*halves).vertices.round(6), axis=0, return_inverse=True
    )
    both = (
        TriangleMesh(vertices, places[merged(*halves).faces])
        if has_common_vertices
        else merged(*halves)
    )
    surface = from_surface(both, **COARSE)
    require_sound(surface, surfaces=2)
    assert signed_volume(surface.whole) == pytest.approx(
        sum(map(signed_volume, halves)), rel=0.01
    )
    assert area(surface.whole) == pytest.approx(sum(map(area, halves)), rel=0.02)
    assert smallest_gap(*pieces(surface.whole)) == pytest.approx(0.5, abs=0.05)
    assert Facts("0.5 mm") in surface.report["warnings"]


@pytest.mark.parametrize("source", ["hemisphere", "hemispheres", "pial"])
def test_an_open_medial_wall_is_capped_and_the_cap_left_out(source):
    left, right, _ = shapes.cut_ellipsoid()
    right, settings = shapes.moved(right, 1.0), COARSE
    if source == "hemisphere":
        surface = from_surface(left, "left", **settings)
    elif source == "hemispheres":
        surface = from_hemispheres(left, right, **settings)
    else:
        surface = from_surface(merged(left, right), **settings)
    sides = [side for side in (surface.left, surface.right) if side]
    assert is_closed(surface.whole)
    assert not self_intersecting_faces(surface.whole).any()
    assert [euler_number(piece) for piece in pieces(surface.whole)] == [2] * len(sides)
    assert [area(side) for side in sides] == pytest.approx(
        [area(left)] * len(sides), rel=0.02
    )
    assert surface.report["area_cm2"]["whole"] == pytest.approx(
        sum(map(area, sides)) / 100
    )
    assert area(surface.whole) == pytest.approx(
        (area(left) + np.pi * 28.0 * 24.0) * len(sides), rel=0.02
    )
    assert [
        warning for warning in surface.report["warnings"] if warning == Facts("56 mm")
    ]
    measured = measure_brain(
        surface.whole,
        surface.left,
        surface.right,
        curvature_radius_mm=6.0,
        spangy_modes=20,
    )
    metrics = measured.table.set_index(["hemisphere", "metric"])
    assert metrics.loc[("whole", "area"), "value"] == pytest.approx(
        surface.report["area_cm2"]["whole"]
    )


def test_a_wide_hole_elsewhere_is_refused_with_its_size():
    left, right, wall = shapes.cut_ellipsoid()
    closed = merged(left, wall)
    lateral, _ = submesh(
        closed, closed.vertices[closed.faces][:, :, 0].max(axis=1) > -19.0
    )
    whole, _ = submesh(
        merged(left, right),
        np.r_[
            left.vertices[left.faces][:, :, 2].min(axis=1) < 20.0,
            right.faces[:, 0] >= 0,
        ],
    )
    with pytest.raises(
        MeshError, match=r"2\d\.\d mm across", check=Facts("medial wall")
    ):
        from_surface(lateral, "left", **COARSE)
    with pytest.raises(
        MeshError, match=r"2\d\.\d mm across", check=Facts("medial wall")
    ):
        from_hemispheres(lateral, merged(right, flipped(wall)), **COARSE)
    with pytest.raises(MeshError, match=r"mm across", check=Facts("3 mm")):
        from_surface(whole, **COARSE)


def test_split_gives_bulges_back_to_their_hemisphere(phantom):
    vertices = phantom.whole.vertices.copy()
    fissure = phantom.fissure_x_mm
    # a patch of the left medial wall that bulges over the fissure
    patch = (
        np.linalg.norm(
            vertices - [fissure - 1.5, CENTRE_MM[1] + 20, CENTRE_MM[2] + 10], axis=1
        )
        < 4.0
    )
    patch &= vertices[:, 0] < fissure
    assert patch.sum() > 5
    vertices[patch, 0] += 2.0
    mesh = TriangleMesh(vertices, phantom.whole.faces)
    left, right = split(mesh, fissure)
    assert len(pieces(left)) == len(pieces(right)) == 1
    assert len(left.faces) + len(right.faces) == len(mesh.faces)
    assert left.vertices[:, 0].max() > fissure + 0.3


def test_gap_between_balls_is_known():
    one, other, closer = (sphere(5.0, 3, (x, 0.0, 0.0)) for x in (-6.0, 6.0, 2.0))
    assert smallest_gap(one, other) == pytest.approx(2.0, abs=0.05)
    assert smallest_gap(one, closer) == pytest.approx(-2.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("week", "series"), [(21, "notoperated"), (29, "operated")])
def test_real_atlas_labels_give_sound_surfaces(week, series):
    folder = SHIPPED / "atlases" / "spina-bifida" / f"fetal_SB_atlas_GA{week}_{series}"
    volume = read_label_volume(folder / "parcellation.nii.gz")
    surface = from_labels(
        volume.labels, volume.affine, ATLAS, week=float(week), edge_length_mm=1.2
    )
    require_sound(surface)
    report = surface.report
    expected = report["label_volumes_mL"]["cerebrum"] - report["fissure_opened_mL"]
    assert report["volume_mL"] == pytest.approx(expected, rel=0.01)
    # tissue across the open fissure would be a filled tunnel
    assert report["topology"]["voxels_filled_in_tunnels"] < 10
    # this atlas is mirror-symmetric about x = 0
    assert surface.fissure_x_mm == pytest.approx(0.0, abs=0.1)
    assert report["area_cm2"]["left"] == pytest.approx(
        report["area_cm2"]["right"], rel=0.02
    )
    if week == 21:
        # cortex hides the fissure: the hemispheres of this week, cut apart and closed,
        # have 98.8 cm²; left shut, 75
        assert 85 < report["area_cm2"]["whole"] < 98
        wall = surface.left.vertices[
            np.abs(surface.left.vertices[:, 0] - surface.fissure_x_mm) < 1.5
        ]
        assert np.median(wall[:, 0]) == pytest.approx(-0.75, abs=0.1)


def test_real_labels_and_hemispheres_of_a_week_agree():
    folder = DATA / "hemispheres"
    if not folder.exists():
        pytest.skip(
            f"no example data: {folder} is missing (GYRIFLOW_DATA names its folder)"
        )
    left, right = (
        read_surface(folder / f"fetal.week21.{side}.pial.surf.gii")
        for side in ("left", "right")
    )
    surface = from_hemispheres(left, right, week=21.0, coordinates="lps")
    require_sound(surface, surfaces=2)
    # truth.json of the example data: 49.40 and 49.44 cm², 23.01 and 23.04 mL
    assert surface.report["area_cm2"]["left"] == pytest.approx(49.40, rel=0.01)
    assert surface.report["area_cm2"]["right"] == pytest.approx(49.44, rel=0.01)
    assert surface.report["volume_mL"] == pytest.approx(46.05, rel=0.005)
    assert surface.fissure_x_mm == pytest.approx(0.0, abs=0.1)
