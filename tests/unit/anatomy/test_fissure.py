"""The mid-plane and the fissure of shifted, turned and asymmetric brains, and left and
right of closed surfaces."""

from dataclasses import replace

import numpy as np
import odd_brains
import pytest
from facts import Facts
from phantoms import CENTRE_MM
from scipy import ndimage
from shapes import (
    FAR,
    LONG_MM,
    cerebrum_surface,
    ellipsoid,
    phantom,
    rigid,
    scaling,
    sheet,
    sphere,
)

from gyriflow.anatomy.extraction import handles, isosurface, smooth_mask
from gyriflow.anatomy.fissure import (
    MidPlane,
    cut_share,
    cut_sides,
    fissure_between,
    hidden_fissure,
    largest_pieces,
    left_faces,
    mid_plane,
    open_fissure,
    plane_between_labels,
    separate,
    side_distance,
    smallest_gap,
    upright,
)
from gyriflow.anatomy.pial import _with_fissure, from_labels
from gyriflow.anatomy.repair import pieces
from gyriflow.errors import InputError
from gyriflow.geometry.deformations import transform_points
from gyriflow.geometry.remeshing import remesh
from gyriflow.geometry.triangles import (
    TriangleMesh,
    area,
    corners,
    face_areas,
    flipped,
    merged,
    submesh,
    transformed,
)
from gyriflow.io.yaml_files import SCHEMES


@pytest.fixture(scope="module")
def brain():
    return phantom()


def ball_at(*centre):
    return sphere(10.0, 3, centre)


def test_two_closed_pieces_are_the_hemispheres_though_they_reach_over_the_plane():
    mesh = merged(ball_at(-8.0, 0.0, 0.0), ball_at(12.5, 0.0, 0.0))
    left = left_faces(mesh, corners(mesh)[:, :, 0].mean(axis=1))
    assert left.tolist() == [True] * 1280 + [False] * 1280


@pytest.mark.parametrize(("radius", "asymmetry_mm"), [(10.0, 0.0), (11.0, 1.0)])
def test_asymmetry_is_the_distance_to_the_mirror_image(radius, asymmetry_mm):
    # radii that are equal, or differ by a millimetre
    right = sphere(radius, 3, (14.0, 3.0, 0.0))
    mesh = merged(ball_at(-14.0, 3.0, 0.0), right)
    found = mid_plane(mesh).asymmetry_mm
    assert found == pytest.approx(asymmetry_mm, abs=0.2)


def test_a_lump_beside_a_connected_brain_is_no_hemisphere():
    # whose middle is a little off the plane, on the other side than the lump
    brain = ellipsoid((24, 33, 22), centre=(0.5, 0, 0))
    lump = sphere(8.7, 3, (-38.0, 0.0, 0.0))
    assert 0.1 < area(lump) / area(brain) < 0.12
    mesh = merged(brain, lump)
    left = left_faces(mesh, corners(mesh)[:, :, 0].mean(axis=1))
    to_file = rigid(shift=(100.0, 0.0, 0.0))
    with pytest.raises(
        InputError, check=Facts("left", "2 pieces", "18.2 %", "(62, 0, 0)", "10 %")
    ):
        largest_pieces(mesh, {"left": left, "right": ~left}, to_file)


def test_a_small_piece_beside_a_hemisphere_is_left_out_and_reported():
    mesh = merged(ellipsoid((24, 33, 22)), sphere(4.0, 3, (-38.0, 0.0, 0.0)))
    left = left_faces(mesh, corners(mesh)[:, :, 0].mean(axis=1))
    kept, (warning,) = largest_pieces(mesh, {"left": left, "right": ~left}, np.eye(4))
    share = 201.0 / (201.0 + area(ellipsoid((24, 33, 22))) / 2)
    assert warning == Facts(
        "left", "2 pieces", f"{100 * share:.1f} %", "(-38, 0, 0)", "left out"
    )
    assert len(pieces(submesh(mesh, kept)[0])) == 1


def test_stray_patches_leave_each_hemisphere_in_one_piece():
    mesh = ball_at(0.0, 0.0, 0.0)
    x, y, z = corners(mesh).mean(axis=1).T
    # rings of the right within the left, and of the left within those
    from_pole = np.hypot(x + 10.0, y)
    heights = np.where(
        from_pole < 4.0, np.sin(from_pole * 3.0) + 0.2 * np.sin(9.0 * z), x
    )
    left = left_faces(mesh, heights)
    assert [len(pieces(side)) for side in cut_sides(mesh, left)] == [1, 1]
    assert left[x < -5.0].all()


def test_hemispheres_apart_with_a_bent_midline_are_never_mixed(brain):
    labels, affine = brain
    mesh = cerebrum_surface(
        odd_brains.bent_midline(odd_brains.apart(labels, affine), affine, 6.0), affine
    )
    fissure = fissure_between(mesh, mid_plane(mesh))
    sides = cut_sides(
        mesh, left_faces(mesh, fissure.height_above(corners(mesh).mean(axis=1)))
    )
    assert [len(pieces(side)) for side in sides] == [1, 1]
    assert area(sides[0]) == pytest.approx(area(sides[1]), rel=0.05)


@pytest.mark.parametrize(
    "pathology",
    [odd_brains.bent_midline, odd_brains.without_callosum, odd_brains.shifted_midline],
)
def test_a_brain_of_one_piece_is_cut_in_its_fissure(brain, pathology):
    labels, affine = brain
    mesh = cerebrum_surface(pathology(labels, affine), affine)
    fissure = fissure_between(mesh, mid_plane(mesh))
    left = left_faces(mesh, fissure.height_above(corners(mesh).mean(axis=1)))
    sides = cut_sides(mesh, left)
    assert [len(pieces(side)) for side in sides] == [1, 1]
    place = corners(mesh).mean(axis=1) - CENTRE_MM
    middle = {
        "bent_midline": 3.0 * np.sin(place[:, 1] / 12.0),
        "shifted_midline": 8.0,
    }.get(pathology.__name__, 0.0)
    wrong = np.where(left, place[:, 0] - middle, middle - place[:, 0]) > 1.5
    assert face_areas(mesh)[wrong].sum() < 0.005 * area(mesh)


def test_a_cut_that_does_not_part_the_surface_is_refused():
    mesh = ball_at(0.0, 0.0, 0.0)
    stripes = np.sin(corners(mesh)[:, :, 0].mean(axis=1) * 1.2)
    with pytest.raises(InputError, check=Facts("37 %", "5 %")):
        left_faces(mesh, stripes)


@pytest.mark.parametrize("is_left", [True, False])
def test_a_brain_on_one_side_of_the_fissure_is_refused(is_left):
    mesh = ball_at(0.0, 0.0, 0.0)
    left = np.full(len(mesh.faces), is_left)
    count = len(mesh.faces)
    with pytest.raises(InputError, check=Facts(f"{count * is_left} of {count}")):
        cut_sides(mesh, left)


def test_the_plane_between_labels_is_half_way_in_mm_wherever_the_brain_lies():
    # a wedge of 40° without labels, in long voxels
    shape = (80, 64, 40)
    grid = scaling(LONG_MM, -0.5 * np.array(shape) * LONG_MM)
    x, y, z = transform_points(np.indices(shape).reshape(3, -1).T, grid).T
    bottom = -18.0
    left = x < 0
    right = x > np.tan(np.radians(40)) * (z - bottom)
    inside = (x / 14) ** 2 + (y / 20) ** 2 + (z / 10) ** 2 < 1
    masks = [mask.reshape(shape) for mask in (left, right, inside)]
    left, right, brain = masks
    plane = plane_between_labels(left, right, FAR[1] @ grid, brain)
    tilt = np.radians(20)
    normal = FAR[1][:3, :3] @ [np.cos(tilt), 0.0, -np.sin(tilt)]
    assert angle_to(plane, normal) < 1.0
    on_plane = transform_points(np.array([[0.0, 0.0, bottom]]), FAR[1])[0]
    assert plane.offset == pytest.approx(plane.normal @ on_plane, abs=0.5)


def test_a_bend_of_more_than_5_mm_is_followed():
    # two walls 2 mm apart whose middle bends away from the plane by 9 mm
    y, z = np.meshgrid(
        np.arange(-40.0, 40.0, 1.0), np.arange(-20.0, 20.0, 1.0), indexing="ij"
    )
    middle = 9.0 * np.exp(-((y / 15.0) ** 2))
    left, right = (sheet(middle + x, y, z) for x in (-1.0, 1.0))
    mesh = merged(
        left,
        flipped(right),
        flipped(sheet(0 * y - 35.0, y, z)),
        sheet(0 * y + 35.0, y, z),
    )
    plane = MidPlane(np.array([1.0, 0.0, 0.0]), 0.0, 0.0, 0)
    fissure = fissure_between(mesh, plane)
    for at in (-30.0, -12.0, 0.0, 12.0):
        place = np.array([[9.0 * np.exp(-((at / 15.0) ** 2)), at, 0.0]])
        assert abs(fissure.height_above(place)[0]) < 1.0


MIDDLE = MidPlane(np.array([1.0, 0.0, 0.0]), 18.0, 0.0, 0)
"""The plane in the middle of the blocks below."""


def block(gap_voxels):
    """Return two blocks of core in cortex, joined by a bar, with a gap of CSF between
    their cortex, and the affine."""
    brain, core = np.zeros((41, 40, 30), dtype=bool), np.zeros((41, 40, 30), dtype=bool)
    brain[4:37, 4:36, 4:26] = True
    core[6:18, 6:34, 6:24], core[23:35, 6:34, 6:24] = True, True
    core[18:23, 12:28, 6:12] = True
    if gap_voxels:
        first = 20 - gap_voxels // 2
        brain[first : first + gap_voxels, :, 14:] = False
        brain[first : first + gap_voxels, :10] = brain[
            first : first + gap_voxels, 30:
        ] = False
    return brain, core, np.diag([0.9, 0.9, 0.9, 1.0])


@pytest.mark.parametrize(("gap_voxels", "open_voxels"), [(0, 1), (1, 0)])
def test_only_a_fissure_that_is_hidden_is_opened(gap_voxels, open_voxels):
    brain, core, affine = block(gap_voxels)
    walls = isosurface(smooth_mask(core, 1.0), affine)
    side_mm = side_distance(brain, core, affine, fissure_between(walls, MIDDLE))
    hidden = hidden_fissure(side_mm, brain, core, affine)
    field = smooth_mask(brain, 0.5)
    to_hidden = (
        ndimage.distance_transform_edt(~hidden, sampling=0.9)
        if hidden.any()
        else np.full(brain.shape, np.inf)
    )
    wide = open_fissure(field, affine, side_mm, to_hidden)
    # cortex beside a fissure that CSF shows stays; a hidden one is opened
    taken = (field > 0.5) & (wide <= 0.5)
    assert bool(taken[18:23, 15:25, 17:24].any()) == bool(open_voxels)
    assert not (wide[20, 20, 17:24] > 0.5).any()


def test_the_order_in_which_long_voxels_are_stored_does_not_change_the_fissure():
    brain, core, _ = block(0)
    affine = scaling((0.9, 0.7, 1.1))
    walls = isosurface(smooth_mask(core, 1.0), affine)
    side_mm = side_distance(
        brain, core, affine, fissure_between(walls, mid_plane(walls))
    )
    field, _, removed_ml = _with_fissure(smooth_mask(brain), affine, side_mm, core)
    order = [2, 0, 1]
    found, _, found_ml = _with_fissure(
        smooth_mask(brain).transpose(order),
        affine[:, [*order, 3]],
        side_mm.transpose(order),
        core.transpose(order),
    )
    assert removed_ml == pytest.approx(found_ml, rel=1e-4)
    assert removed_ml > 0.1
    np.testing.assert_allclose(found.transpose(np.argsort(order)), field, atol=1e-4)


def test_a_hidden_fissure_is_opened_where_no_tissue_joins_the_hemispheres():
    brain, core, affine = block(0)
    core[18:23] = False
    walls = isosurface(smooth_mask(core, 1.0), affine)
    side_mm = side_distance(
        brain, core, affine, fissure_between(walls, mid_plane(walls))
    )
    hidden = hidden_fissure(side_mm, brain, core, affine)
    # from one end of the brain to the other, in layers beside the middle
    assert hidden[20, 8:32, 8:22].all()
    assert not hidden[:18].any()
    assert not hidden[23:].any()


@pytest.mark.parametrize("gap_voxels", [0, 1])
@pytest.mark.parametrize("shift_mm", [-0.05, 0.05])
def test_noise_of_the_mid_plane_does_not_give_the_middle_to_one_side(
    gap_voxels, shift_mm
):
    # the layer of voxels in the middle is equally far from both cores
    brain, core, affine = block(gap_voxels)
    normal = np.array([1.0, 0.0, 0.0])
    walls = isosurface(smooth_mask(core, 1.0), affine)
    fissure = fissure_between(walls, MidPlane(normal, 18.0 + shift_mm, 0.0, 0))
    flat = replace(fissure, heights=np.zeros_like(fissure.heights))
    side_mm = side_distance(brain, core, affine, flat)
    assert side_mm[20] == pytest.approx(0.0, abs=0.01)
    assert side_mm[:20] == pytest.approx(-side_mm[:20:-1], abs=0.01)


def test_tissue_that_crosses_a_fissure_is_opened():
    brain, core, affine = block(1)
    # no cortex between the tissue that joins the hemispheres and what lies below
    core[18:23, 12:28, 4:6] = True
    walls = isosurface(smooth_mask(core, 1.0), affine)
    brain[20, 18:21, 25] = True
    side_mm = side_distance(brain, core, affine, fissure_between(walls, MIDDLE))
    hidden = hidden_fissure(side_mm, brain, core, affine, bridges=True)
    to_hidden = ndimage.distance_transform_edt(~hidden, sampling=0.9)
    opened = open_fissure(brain.astype(np.float32), affine, side_mm, to_hidden) > 0.5
    assert (handles(brain), handles(opened)) == (1, 0)
    assert (brain & ~opened)[:, :, 17:].sum() == 3


@pytest.mark.parametrize("sided", [False, True])
def test_gyri_that_reach_over_the_middle_are_on_their_own_side(sided):
    # cores of two hemispheres, joined below; a gyrus of the left one reaches 4 mm over
    # the middle, cortex all around
    x, y, z = (
        np.indices((61, 40, 40)) - np.array([30.0, 20.0, 0.0])[:, None, None, None]
    )
    right = x > np.where((np.abs(y) < 6) & (np.abs(z - 25) < 6), 4, 0)
    brain = (np.abs(x) < 27) & (np.abs(y) < 17) & (z > 3) & (z < 37)
    inner = ndimage.binary_erosion(brain, iterations=2)
    gap = (
        ndimage.distance_transform_edt(right)
        + ndimage.distance_transform_edt(~right)
        - 1.0
    )
    core = inner & ((gap > 2.0) | (z < 12))
    affine = np.eye(4)
    affine[:3, 3] = [-30, -20, 0]
    walls = isosurface(smooth_mask(core, 1.0), affine)
    labels = [brain & ~right, brain & right] if sided else []
    side_mm = side_distance(
        brain,
        core,
        affine,
        fissure_between(walls, replace(MIDDLE, offset=0.0)),
        *labels,
    )
    above = brain & (z > 14)
    assert ((side_mm > 0) == right)[above].mean() > 0.99
    hidden = hidden_fissure(side_mm, brain, core, affine)
    opened = (
        open_fissure(
            smooth_mask(brain), affine, side_mm, ndimage.distance_transform_edt(~hidden)
        )
        <= 0.5
    )
    number, _ = ndimage.label(~opened & brain & (z > 14))
    assert number[50, 20, 30] != number[10, 20, 30]
    assert not opened[core].any()


@pytest.mark.parametrize(("overlap_mm", "is_refused"), [(18.5, False), (20.5, True)])
def test_hemispheres_are_moved_apart_by_at_most_a_centimetre_each(
    overlap_mm, is_refused
):
    # along a direction that is no axis
    to_right = np.array([0.8, 0.6, 0.0])
    left, right = (
        sphere(15.0, 3, side * (15.0 - overlap_mm / 2) * to_right) for side in (-1, 1)
    )
    if is_refused:
        with pytest.raises(InputError, check=Facts("20 mm")):
            separate(left, right, 0.5, to_right)
        return
    first, second, moved_mm = separate(left, right, 0.5, to_right)
    assert moved_mm == pytest.approx(overlap_mm / 2 + 0.25, abs=0.3)
    assert smallest_gap(first, second) >= 0.5
    for found, given, sign in ((first, left, -1), (second, right, 1)):
        shift = sign * moved_mm * to_right
        assert found.vertices == pytest.approx(given.vertices + shift)


def test_the_share_of_a_cut_is_that_of_the_medial_wall():
    ball = ball_at(0.0, 0.0, 0.0)
    x = corners(ball)[:, :, 0].mean(axis=1)
    left, right = cut_sides(ball, x < -6.0)
    # radius 8 of 10
    assert cut_share(left) == pytest.approx(1.0, abs=0.03)
    assert cut_share(right) == pytest.approx(0.64, abs=0.03)
    assert cut_share(ball) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.usefixtures("few_starts")
def test_a_narrow_fissure_shown_by_csf_keeps_its_width(brain):
    labels, affine = brain
    x, _, _ = odd_brains.positions(labels, affine)
    cerebrum = np.isin(labels, odd_brains.CEREBRUM)
    # one voxel of CSF in the middle, cortex beside it
    middle = np.abs(x) < 0.61
    filled = np.where((labels == 4) & (np.abs(x) < 3.0), 5, labels)
    shown = np.where((labels == 4) & middle & (filled == 5), 4, filled)
    surface = from_labels(
        shown, affine, SCHEMES["spina-bifida-atlas"], week=24.0, edge_length_mm=2.0
    )
    assert cerebrum.sum() < np.isin(shown, odd_brains.CEREBRUM).sum()
    assert surface.report["fissure_opened_mL"] < 0.002 * surface.report["volume_mL"]
    assert surface.report["area_cm2"]["whole"] > 110.0


@pytest.fixture(scope="module")
def centred():
    mesh = cerebrum_surface(*phantom())
    # the phantom's own centre to the origin: its fissure is x = 0 there
    return TriangleMesh(mesh.vertices - CENTRE_MM, mesh.faces)


def angle_to(plane, normal):
    return np.degrees(
        np.arccos(np.clip(plane.normal @ normal / np.linalg.norm(normal), -1, 1))
    )


@pytest.mark.parametrize("turn", [(0, 0, 45), (30, 20, -30)])
def test_turned_and_shifted_brain(centred, turn):
    matrix = rigid(*turn, shift=(31.0, -4.0, 9.0))
    plane = mid_plane(transformed(centred, matrix))
    assert angle_to(plane, matrix[:3, 0]) < 1.0
    # the origin of the unmoved brain lies in its fissure
    assert plane.offset - plane.normal @ matrix[:3, 3] == pytest.approx(0.0, abs=0.4)
    assert plane.fissure_points > 500


def test_sheared_brain_where_symmetry_and_fissure_differ(centred):
    shear = (-0.1, 0.1)
    matrix = np.eye(4)
    matrix[0, 1:3] = shear
    plane = mid_plane(transformed(centred, matrix))
    assert angle_to(plane, np.array([1.0, *(-s for s in shear)])) < 1.5
    assert plane.offset == pytest.approx(0.0, abs=0.4)


def test_brain_with_a_larger_right_hemisphere(centred):
    vertices = centred.vertices.copy()
    vertices[vertices[:, 0] > 0, 0] *= 1.25
    mesh = TriangleMesh(vertices, centred.faces)
    middle_of_box = 0.5 * (vertices[:, 0].min() + vertices[:, 0].max())
    plane = mid_plane(mesh)
    assert abs(middle_of_box) > 1.0
    assert angle_to(plane, np.array([1.0, 0, 0])) < 1.0
    assert plane.offset == pytest.approx(0.0, abs=0.5)


def test_upright_turns_the_plane_to_constant_x_and_little_else():
    rotation = rigid(0, 15, -25)
    centre = np.array([3.0, -20.0, 11.0])
    plane = MidPlane(rotation[:3, 0], 4.0, 0.0, 0)
    matrix, angle = upright(plane, centre)
    assert matrix[:3, :3] @ plane.normal == pytest.approx([1, 0, 0], abs=1e-9)
    assert angle == pytest.approx(np.degrees(np.arccos(rotation[0, 0])))
    assert matrix[:3, :3] @ centre + matrix[:3, 3] == pytest.approx(centre, abs=1e-9)
    # anterior and superior keep their sense
    assert (matrix @ rotation)[1, 1] > 0.9
    assert (matrix @ rotation)[2, 2] > 0.9


def test_tiny_tilt_is_left_alone():
    plane = MidPlane(rigid(0, 0, 0.2)[:3, 0], 0.0, 0.0, 0)
    matrix, angle = upright(plane, np.zeros(3))
    assert angle == 0.0
    assert np.array_equal(matrix, np.eye(4))


def test_named_coordinates_are_kept_by_a_body_with_many_mirror_planes(centred):
    # bodies of revolution about z and, of coarse and uneven triangles, about y
    for body in (
        ellipsoid((24.0, 24.0, 33.0)),
        remesh(ellipsoid((30.0, 36.0, 30.0)), 2.5),
    ):
        assert angle_to(
            mid_plane(body, named=True), np.array([1.0, 0, 0])
        ) == pytest.approx(0.0, abs=1e-6)
    # a brain has one plane, in whatever coordinates
    rotation = rigid(0, 15, -25)
    assert (
        angle_to(mid_plane(transformed(centred, rotation), named=True), rotation[:3, 0])
        < 1.0
    )


@pytest.mark.usefixtures("quick_poses")
@pytest.mark.parametrize("deep", [False, True])
def test_a_mask_whose_fissure_is_closed_is_reported(deep):
    x, y, z = np.indices((56, 66, 56)) - np.array([28, 33, 28])[:, None, None, None]
    mask = (x / 23) ** 2 + (y / 28) ** 2 + (z / 22) ** 2 < 1
    # a gap between the hemispheres, but for what joins them
    mask &= ~((abs(x) < 2) & (z > -14)) | (not deep)
    surface = from_labels(
        mask.astype(np.int32),
        np.eye(4),
        SCHEMES["binary"],
        week=24.0,
        edge_length_mm=2.0,
    )
    share = surface.report["cut_share"]
    # all of the medial wall, or what lies below the gap
    assert share == pytest.approx(0.13 if deep else 1.0, abs=0.03)
    assert (
        Facts("midline", f"{100 * share:.0f} %", "33 %", "week 24")
        in surface.report["warnings"]
    ) != deep
