"""Whole pial surfaces from each kind of input: closed, posed, honest in size, split at
the fissure or by labels of the sides; and simple shapes."""

import json
import os
import re
from functools import cache
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

from gyriflow.anatomy import repair
from gyriflow.anatomy.fissure import cut_share, smallest_gap
from gyriflow.anatomy.pial import (
    from_hemispheres,
    from_labels,
    from_shape,
    from_surface,
)
from gyriflow.anatomy.plausible import (
    expected_volume_ml,
    max_cut_share,
    require_plausible_size,
)
from gyriflow.anatomy.repair import pieces
from gyriflow.anatomy.shapes import shape_surface
from gyriflow.errors import InputError, MeshError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.remeshing import self_intersecting_faces
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    corners,
    edges,
    euler_number,
    face_areas,
    face_normals,
    flipped,
    is_closed,
    mean_edge_length,
    merged,
    signed_volume,
    submesh,
    transformed,
    unit,
)
from gyriflow.io.surfaces import read_surface
from gyriflow.io.volumes import LabelSource, read_label_volume
from gyriflow.io.yaml_files import SCHEMES
from gyriflow.mesh.maps import move_to_mesh
from gyriflow.settings.schemes import LabelScheme
from gyriflow.shipped import SHIPPED
from gyriflow.units import ML_PER_MM3

DATA = Path(
    os.environ.get("GYRIFLOW_DATA", Path(__file__).parents[4] / "shared" / "data")
)
ATLAS = SCHEMES["spina-bifida-atlas"]
COARSE = {"week": 24.0, "edge_length_mm": 3.0}
pytestmark = pytest.mark.usefixtures("few_starts")


@pytest.fixture(scope="module")
def volume():
    return shapes.phantom(24.0, 2.0)


@cache
def phantom_surface():
    return from_labels(*shapes.phantom(24.0, 2.0), ATLAS, **COARSE)


@pytest.fixture
def phantom(few_starts):
    return phantom_surface()


@pytest.fixture(scope="module")
def halves():
    """The phantom's left and right hemispheres as closed surfaces a millimetre apart,
    where its volume has them."""
    both = shapes.phantom_halves(24.0, 1.6)
    return [shapes.moved(half, *CENTRE_MM) for half in both]


def require_sound(surface, surfaces=1):
    whole, left, right = surface.whole, surface.left, surface.right
    assert is_closed(whole)
    assert [euler_number(piece) for piece in pieces(whole)] == [2] * surfaces
    assert all(signed_volume(piece) > 0 for piece in pieces(whole))
    assert not self_intersecting_faces(whole).any()
    assert len(left.faces) + len(right.faces) == len(whole.faces)
    x_left, x_right = (side.vertices[:, 0].mean() for side in (left, right))
    assert x_left < surface.fissure_x_mm < x_right
    assert area(left) + area(right) == pytest.approx(area(whole))
    json.dumps(surface.report, allow_nan=False)


def test_phantom_surface_is_sound_and_as_its_report_says(phantom):
    require_sound(phantom)
    report, volume_ml = phantom.report, signed_volume(phantom.whole) / 1e3
    inside_ml = report["label_volumes_mL"]["cerebrum"] - report["fissure_opened_mL"]
    assert volume_ml == pytest.approx(inside_ml, rel=0.015)
    assert phantom.fissure_x_mm == pytest.approx(CENTRE_MM[0], abs=0.4)
    expected = {
        "scheme": ATLAS.name,
        "volume_mL": pytest.approx(volume_ml),
        "usual_cut_share": max_cut_share(24.0),
        "cut_share": pytest.approx(cut_share(phantom.left, phantom.right)),
        "extents_mm": pytest.approx(np.ptp(phantom.whole.vertices, axis=0).tolist()),
    }
    assert {name: report[name] for name in expected} == expected
    assert report["area_cm2"]["left"] == pytest.approx(area(phantom.left) / 100)
    assert report["area_cm2"]["right"] == pytest.approx(area(phantom.right) / 100)
    assert report["rotation_deg"] < 1.0
    assert report["fissure_points"] > 100
    assert report["asymmetry_mm"] < 1.0
    smoothing = report["smoothing"]
    change = volume_ml / smoothing["volume_expected_mL"] - 1
    assert smoothing["volume_change"] == pytest.approx(change, abs=1e-6)
    assert abs(change) < 1e-4 < abs(smoothing["volume_change_before_correction"])
    assert smoothing["volume_expected_mL"] == pytest.approx(inside_ml, rel=2e-3)
    assert smoothing["terraces_moved_mm"] < smoothing["terraces_moved_most_mm"]


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
    warnings = surface.report["warnings"]
    assert Facts("areas", f"{percent:.0f} %") in warnings
    assert Facts("mirror-symmetric", f"{asymmetry:.1f} mm") in warnings
    assert Facts("no fissure") not in warnings
    assert surface.fissure_x_mm == pytest.approx(100.8, abs=0.7)
    assert surface.report["pieces"] == 2


def test_oblique_affine_and_storage_order_give_the_same_areas(volume, phantom):
    labels, affine = volume
    mirrored = affine @ np.diag([1.0, -1.0, 1.0, 1.0])
    mirrored[:3, 3] += affine[:3, 1] * (labels.shape[1] - 1)
    oblique = rigid(20, -30, 10)
    turned = from_labels(labels[:, ::-1], oblique @ mirrored, ATLAS, **COARSE)
    require_sound(turned)
    assert turned.report["area_cm2"] == pytest.approx(
        phantom.report["area_cm2"], rel=0.005
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


def test_wrong_unit_is_caught_in_each_kind_of_input(volume, phantom, halves):
    labels, affine = volume
    facts = Facts(24, "mL", "centimetres")
    with pytest.raises(InputError, check=facts):
        from_labels(labels, scaling(0.1) @ affine, ATLAS, week=24.0)
    with pytest.raises(InputError, check=facts):
        from_surface(transformed(phantom.whole, scaling(0.1)), week=24.0)
    with pytest.raises(InputError, check=facts):
        from_hemispheres(*(transformed(half, scaling(0.1)) for half in halves), week=24)


@pytest.mark.parametrize(
    # with the wrong unit of a header that may give the same size, if any
    ("factor", "units"),
    [
        (1e-3, ["metres", "header says micrometres"]),
        (1e3, ["micrometres", "header says metres"]),
        (0.1, ["centimetres"]),
    ],
)
def test_wrong_unit_is_named(factor, units):
    volume_mm3 = factor**3 * expected_volume_ml(24.0) / ML_PER_MM3
    with pytest.raises(InputError, check=Facts(24, "mL", *units)):
        require_plausible_size(volume_mm3, 24.0)


def test_two_brains_in_one_volume_are_not_one_hemisphere(volume):
    labels, affine = volume
    both = np.concatenate([labels, labels], axis=1)
    with pytest.raises(InputError, check=Facts("2 separate brains")):
        from_labels(both, affine, ATLAS, **COARSE)


def test_hemispheres_are_merged_apart_and_whole(halves):
    surface = from_hemispheres(*halves, **COARSE)
    require_sound(surface, surfaces=2)
    # in triangles of the length that is asked for
    assert mean_edge_length(surface.whole) == pytest.approx(3.0, rel=0.2)
    assert surface.report["moved_apart_mm"] == 0.0
    assert is_closed(surface.left)
    assert signed_volume(surface.whole) == pytest.approx(
        sum(map(signed_volume, halves)), rel=0.01
    )
    assert surface.fissure_x_mm == pytest.approx(CENTRE_MM[0], abs=0.4)
    assert smallest_gap(*pieces(surface.whole)) > 0.5


def test_hemispheres_that_share_the_vertices_of_their_cut_are_joined_along_it(phantom):
    surface = from_hemispheres(
        phantom.left, phantom.right, coordinates="auto", **COARSE
    )
    require_sound(surface)
    assert surface.report["source"] == "hemispheres"
    assert surface.report["joined_along_cut"]
    volume = signed_volume(phantom.whole)
    assert signed_volume(surface.whole) == pytest.approx(volume, rel=0.01)
    assert area(surface.left) == pytest.approx(area(phantom.left), rel=0.03)
    with pytest.raises(InputError, check=Facts("left", "right", "RAS+")):
        from_hemispheres(phantom.right, phantom.left, coordinates="auto", **COARSE)


@pytest.mark.remeshed
@pytest.mark.usefixtures("recorded_outputs")
def test_labels_of_a_hemisphere_give_its_surface_and_thickness(tmp_path):
    labels, affine = shapes.phantom(24.0, (1.9, 2.1, 2.4))
    scheme = SCHEMES["dhcp-19"]
    sided = odd_brains.add_sides(labels, affine)
    left = odd_brains.one_hemisphere(sided, affine, "left")
    shapes.save_labels(tmp_path / "labels.nii.gz", left, shapes.FAR[0] @ affine)
    names = ("whole", "left", "thickness", "measured")
    outputs = {name: f"{name}.gii" for name in names}
    outputs |= {name: f"{name}.json" for name in ("report", "summary")}
    params = {
        "source": "labels",
        "week": 24.0,
        "side": "left",
        "labels": LabelSource(str(tmp_path / "labels.nii.gz"), "auto", scheme),
        "checksums": {},
        "settings": {"edge_length_mm": 3.0},
    }
    run_script("pial.py", tmp_path, {"given": [], "white": []}, outputs, params)


def test_overlapping_hemispheres_are_moved_apart(halves):
    given = {
        "left": transformed(shapes.moved(halves[0], 2.5), LPS),
        "right": transformed(halves[1], LPS),
    }
    surface = from_hemispheres(*given.values(), coordinates="lps", **COARSE)
    require_sound(surface, surfaces=2)
    moved_mm = surface.report["moved_apart_mm"]
    assert surface.report["gap_before_mm"] < 0
    assert 0.5 < moved_mm < 2.0
    assert smallest_gap(*pieces(surface.whole)) == pytest.approx(0.5, abs=0.1)
    assert Facts(f"{moved_mm:.2f} mm", "0.5 mm") in surface.report["warnings"]
    # white surfaces and maps of either file follow its hemisphere
    for side, mesh in given.items():
        followed = transformed(mesh, surface.pose.of_file(side)).vertices
        distance, _, _ = nearest_on(followed, getattr(surface, side))
        assert np.quantile(distance, 0.95) < 0.4


@pytest.mark.slow
def test_maps_on_surfaces_in_lps_and_volumes_beside_them_lie_on_the_brain():
    left, right = atlas_halves()
    halves = [shapes.moved(left, -0.6), shapes.moved(right, 0.6)]
    world = merged(*halves)
    sides, whole = [transformed(half, LPS) for half in halves], transformed(world, LPS)
    auto = {"week": 24.0, "coordinates": "auto", "edge_length_mm": 2.5}
    lps = auto | {"coordinates": "lps"}
    for surface, given, in_world in (
        (from_surface(whole, **auto), whole, world),
        (from_surface(sides[1], "right", **auto), sides[1], halves[1]),
        (from_hemispheres(*sides, **lps), whole, world),
    ):
        points = surface.whole.vertices
        on_mesh = move_to_mesh(points, given, surface.pose.of_file())
        # a volume knows the brain in the world, which is RAS+
        in_volume = transformed(in_world, surface.pose.of_volume("a.nii"))
        for found in (on_mesh, in_volume):
            for end in (np.min, np.max):
                expected = pytest.approx(end(points, axis=0), abs=1.5)
                assert end(found.vertices, axis=0) == expected


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
    about = rigid(shift=centre) @ change @ rigid(shift=-centre)
    changed = transformed(halves[1], about)
    with pytest.raises(InputError, check=Facts(bound, "surface.asymmetric")):
        from_hemispheres(halves[0], changed, **COARSE)


def test_pial_surface_with_a_small_hole_is_closed(phantom):
    areas = face_areas(phantom.whole)
    holed, _ = submesh(phantom.whole, areas > areas.min())
    surface = from_surface(transformed(holed, LPS), coordinates="lps", **COARSE)
    require_sound(surface)
    assert surface.report["repair"]["holes_closed"] == 1
    assert surface.report["self_intersections"] == 0
    assert area(surface.whole) == pytest.approx(area(phantom.whole), rel=0.02)
    assert surface.fissure_x_mm == pytest.approx(phantom.fissure_x_mm, abs=0.2)


@pytest.mark.slow
def test_pial_surface_that_cuts_itself_is_made_anew(phantom):
    vertices = phantom.whole.vertices.copy()
    # the left hemisphere's medial wall pushed through the right one's
    from_fissure = vertices[:, 0] - phantom.fissure_x_mm
    wall = (from_fissure > -3.0) & (from_fissure < 0.0)
    wall &= vertices[:, 2] > CENTRE_MM[2] + 10.0
    vertices[wall, 0] += 4.0
    tangled = TriangleMesh(vertices, phantom.whole.faces)
    assert self_intersecting_faces(tangled).sum() > 20
    surface = from_surface(tangled, **COARSE)
    require_sound(surface)
    volume = signed_volume(tangled)
    assert signed_volume(surface.whole) == pytest.approx(volume, rel=0.03)


def test_hemispheres_that_share_their_medial_wall_in_one_file_are_moved_apart():
    left, right, wall = shapes.cut_ellipsoid()
    halves = [merged(left, wall), merged(right, flipped(wall))]
    both = merged(*halves)
    vertices, places = np.unique(both.vertices.round(6), axis=0, return_inverse=True)
    surface = from_surface(TriangleMesh(vertices, places[both.faces]), **COARSE)
    require_sound(surface, surfaces=2)
    whole = surface.whole
    assert signed_volume(whole) == pytest.approx(signed_volume(both), rel=0.01)
    assert area(whole) == pytest.approx(sum(map(area, halves)), rel=0.02)
    assert smallest_gap(*pieces(whole)) == pytest.approx(0.5, abs=0.05)
    assert Facts("0.5 mm") in surface.report["warnings"]


@pytest.mark.parametrize("source", ["hemisphere", "hemispheres", "pial"])
def test_an_open_medial_wall_is_capped_and_the_cap_left_out(source):
    left, right, _ = shapes.cut_ellipsoid()
    right = shapes.moved(right, 1.0)
    if source == "hemisphere":
        surface = from_surface(left, "left", **COARSE)
    elif source == "hemispheres":
        surface = from_hemispheres(left, right, **COARSE)
    else:
        surface = from_surface(merged(left, right), **COARSE)
    sides = [side for side in (surface.left, surface.right) if side]
    count = 1 if source == "hemisphere" else 2
    assert [area(side) for side in sides] == pytest.approx(
        [area(left)] * count, rel=0.02
    )
    whole, report = surface.whole, surface.report
    assert is_closed(whole)
    assert not self_intersecting_faces(whole).any()
    assert [euler_number(piece) for piece in pieces(whole)] == [2] * count
    with_caps = count * (area(left) + np.pi * 28.0 * 24.0)
    assert area(whole) == pytest.approx(with_caps, rel=0.02)
    without_caps = sum(map(area, sides)) / 100
    assert report["area_cm2"]["whole"] == pytest.approx(without_caps)
    assert Facts("56 mm") in report["warnings"]


def test_a_wide_hole_elsewhere_is_refused_with_its_size():
    left, right, wall = shapes.cut_ellipsoid()
    closed = merged(left, wall)
    is_medial = corners(closed)[:, :, 0].max(axis=1) > -19.0
    lateral, _ = submesh(closed, is_medial)
    with pytest.raises(MeshError, match=r"2\d\.\d mm ac", check=Facts("medial wall")):
        from_surface(lateral, "left", **COARSE)
    is_below = corners(left)[:, :, 2].min(axis=1) < 20.0
    whole = merged(submesh(left, is_below)[0], right)
    with pytest.raises(MeshError, match=r"mm across", check=Facts("3 mm")):
        from_surface(whole, **COARSE)


@pytest.mark.slow
def test_real_atlas_labels_give_a_sound_surface():
    folder = SHIPPED / "atlases" / "spina-bifida" / "fetal_SB_atlas_GA21_notoperated"
    volume = read_label_volume(folder / "parcellation.nii.gz")
    surface = from_labels(
        volume.labels, volume.affine, ATLAS, week=21.0, edge_length_mm=1.2
    )
    require_sound(surface)
    report = surface.report
    # tissue across the open fissure would be a filled tunnel
    assert report["topology"]["voxels_filled_in_tunnels"] < 10
    # this atlas is mirror-symmetric about x = 0
    assert surface.fissure_x_mm == pytest.approx(0.0, abs=0.1)
    areas = report["area_cm2"]
    assert areas["left"] == pytest.approx(areas["right"], rel=0.02)
    # cortex hides the fissure: the hemispheres of this week, cut apart and closed, have
    # 98.8 cm²; left shut, 75
    assert 85 < areas["whole"] < 98
    x = surface.left.vertices[:, 0]
    assert np.median(x[np.abs(x) < 1.5]) == pytest.approx(-0.75, abs=0.1)


@pytest.mark.slow
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


SIDED = LabelScheme(
    name="sided", cerebrum=(1, 2, 3, 4, 5), cortex=(3, 4), left=(1, 3), right=(2, 4)
)


def test_hemispheres_are_parted_where_the_labels_of_the_sides_meet():
    # at a surface bent by 4 mm, cortex on both sides of it and no gap between: the
    # phantom's own fissure is filled
    labels, affine = shapes.phantom(24.0, 2.0)
    x, y, _ = odd_brains.positions(labels, affine)
    gap = (np.abs(x) < 3.0) & (labels == 4)
    right, cortex = x > 4.0 * np.sin(y / 12.0), (labels == 5) | gap
    sided = np.where(
        np.isin(labels, odd_brains.CEREBRUM) | gap, np.where(cortex, 3, 1) + right, 0
    )
    sided[labels == 2] = 5
    surface = from_labels(sided, affine, SIDED, **COARSE)
    to_file = np.linalg.inv(surface.pose.world)
    for part, sign in ((surface.left, -1), (surface.right, 1)):
        places = transform_points(corners(part).mean(axis=1), to_file) - CENTRE_MM
        wrong = sign * (places[:, 0] - 4.0 * np.sin(places[:, 1] / 12.0)) < -1.5
        assert face_areas(part)[wrong].sum() < 0.005 * area(part)


def test_a_side_of_a_few_voxels_is_no_hemisphere():
    labels, affine = shapes.phantom(21.0, 2.0)
    scheme, sided = SCHEMES["dhcp-19"], odd_brains.add_sides(labels, affine)
    left = np.argwhere(np.isin(sided, scheme.left))
    # all but the 40 voxels farthest to the left become the right hemisphere's
    outermost = left[np.argsort(left @ affine[0, :3])][40:]
    sided[tuple(outermost.T)] = dict(zip(scheme.left, scheme.right, strict=True))[3]
    with pytest.raises(InputError, match=r"\d\.\d\d .*\d\d\.\d\d cm²", check=Facts(15)):
        from_labels(sided, affine, scheme, week=21.0, edge_length_mm=4.0)


def test_walls_that_would_cut_are_held_back_while_the_rest_takes_the_volume():
    one = sphere(20.0, 3)
    shift = np.array([2 * one.vertices[:, 0].max() + 0.1, 0.0, 0.0])
    balls = merged(*(sphere(20.0, 3, k * shift) for k in (0, 1)))
    wider, report = repair._with_volume(balls, 1.02 * signed_volume(balls), area(balls))
    assert report["volume_change"] == pytest.approx(0.0, abs=1e-4)
    assert not self_intersecting_faces(wider).any()
    still = np.all(wider.vertices == balls.vertices, axis=1)
    assert 0 < still.mean() < 0.2
    # at the place where the balls nearly touch
    assert np.abs(balls.vertices[still, 0] - shift[0] / 2).max() < 5.0


def test_a_piece_beside_a_hemisphere_is_left_out_with_its_place():
    labels, affine = shapes.phantom(28.0, 2.0)
    labels = odd_brains.add_sides(odd_brains.apart(labels, affine), affine)
    place = np.array([-55.0, 0.0, 0.0])
    labels = np.pad(labels, 15)
    affine = affine @ rigid(shift=(-15.0, -15.0, -15.0))
    from_place = odd_brains.positions(labels, affine) - place[:, None, None, None]
    distance = np.linalg.norm(from_place, axis=0)
    labels[distance < 9.2] = 3
    labels[distance < 7.2] = 5
    # the place is told in the coordinates of the file, which lies on its back
    to_file = rigid(90.0, 0.0, 0.0, shift=(0.0, 90.0, 0.0))
    surface = from_labels(
        labels, to_file @ affine, SCHEMES["dhcp-19"], week=28.0, edge_length_mm=3.0
    )
    facts = Facts("left", "2 pieces")
    (warning,) = [text for text in surface.report["warnings"] if facts == text]
    match = re.search(r"\((-?\d+), (-?\d+), (-?\d+)\) mm", warning)
    (expected,) = transform_points((place + CENTRE_MM)[None], to_file)
    assert [int(part) for part in match.groups()] == pytest.approx(expected, abs=1.0)
    assert surface.report["pieces"] == 2
    assert [len(pieces(side)) for side in (surface.left, surface.right)] == [1, 1]
    assert surface.whole.vertices[:, 0].min() > -45.0 + CENTRE_MM[0]


SEMI_AXES = (10.0, 13.0, 8.0)


def test_an_ellipsoid_has_the_analytic_size_and_even_triangles_that_look_outwards():
    volume = 4 / 3 * np.pi * np.prod(SEMI_AXES)
    coarse, mesh = (
        shape_surface(SEMI_AXES, edge_length_mm=edge_mm, noise_mm=0.0)
        for edge_mm in (2.0, 1.0)
    )
    assert is_closed(mesh)
    assert euler_number(mesh) == 2
    assert signed_volume(mesh) == pytest.approx(volume, rel=0.01)
    missing = [1 - signed_volume(each) / volume for each in (coarse, mesh)]
    assert missing[0] / missing[1] == pytest.approx(4.0, rel=0.25)
    lengths = np.linalg.norm(np.diff(mesh.vertices[edges(mesh)[0]], axis=1), axis=-1)
    assert lengths.mean() == pytest.approx(1.0, rel=0.1)
    assert 0.2 < lengths.min() < lengths.max() < 2.2
    assert np.linalg.norm(mesh.vertices / SEMI_AXES, axis=1) == pytest.approx(
        1.0, abs=1e-12
    )
    normals = unit(corners(mesh).mean(axis=1) / np.square(SEMI_AXES))
    assert np.einsum("ij,ij->i", normals, face_normals(mesh)).min() > 0.9


def test_bumps_have_the_given_height_and_one_pattern_at_any_edge_length():
    def heights(edge_mm):
        mesh = shape_surface((30.0, 30.0, 30.0), edge_length_mm=edge_mm, noise_mm=0.2)
        return np.linalg.norm(mesh.vertices, axis=1) - 30.0, unit(mesh.vertices)

    fine, directions = heights(3.0)
    assert np.sqrt((fine**2).mean()) == pytest.approx(0.2, rel=0.3)
    assert np.array_equal(fine, heights(3.0)[0])
    coarse, coarse_directions = heights(4.0)
    nearest = (directions @ coarse_directions.T).argmax(axis=1)
    assert np.corrcoef(fine, coarse[nearest])[0, 1] > 0.8


def test_edges_too_long_for_the_shape_are_refused_with_the_bound():
    with pytest.raises(InputError, check=Facts("2.5 mm", "2.46 mm")):
        shape_surface(SEMI_AXES, edge_length_mm=2.5)


def test_a_shape_is_left_as_it_is_and_cut_at_x_0():
    shape = shape_surface((10.0, 8.0, 9.0), edge_length_mm=1.0, noise_mm=0.05)
    surface = from_shape(shape, week=21.0)
    assert np.array_equal(surface.whole.vertices, shape.vertices)
    assert np.array_equal(surface.pose.world, np.eye(4))
    assert surface.fissure_x_mm == 0.0
    expected = {"source": "shape", "week": 21.0, "fissure_x_mm": 0.0, "warnings": []}
    assert {name: surface.report[name] for name in expected} == expected
    left, right = (
        corners(side)[:, :, 0].mean(axis=1) for side in (surface.left, surface.right)
    )
    assert left.max() < 0 < right.min()
    assert area(surface.left) + area(surface.right) == pytest.approx(area(shape))


def test_a_shape_that_is_not_closed_or_cuts_itself_is_refused():
    mesh = shape_surface((15.0, 15.0, 15.0), edge_length_mm=1.5, noise_mm=0.0)
    holed, _ = submesh(mesh, np.arange(len(mesh.faces)) > 0)
    with pytest.raises(MeshError, check=Facts("[1]", 2)):
        from_shape(holed, week=21.0)
    vertices = mesh.vertices.copy()
    vertices[0] *= -1.2
    with pytest.raises(MeshError, check=Facts(8, 2)):
        from_shape(TriangleMesh(vertices, mesh.faces), week=21.0)
