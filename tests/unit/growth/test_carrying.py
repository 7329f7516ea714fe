"""Brains correspond by their matched surfaces or by registration, and what lies on them
is carried along."""

from dataclasses import replace

import numpy as np
import pytest
from facts import Facts
from scipy.ndimage import binary_dilation, gaussian_filter, morphological_gradient
from shapes import (
    FAR,
    LONG_MM,
    LPS,
    ellipsoid_mesh,
    rigid,
    scaling,
    sphere,
    uneven,
)

from gyriflow.errors import InputError
from gyriflow.geometry.deformations import (
    Deformation,
    MatchedSurfaces,
    carry,
    transform_points,
)
from gyriflow.geometry.triangles import TriangleMesh, flipped, transformed
from gyriflow.growth.carrying import (
    carry_over_weeks,
    carry_regions,
    carry_surface,
    follow_surfaces,
    maps_on_template,
    match_surfaces,
    outward,
)
from gyriflow.growth.registration import (
    MARGIN_MM,
    SMOOTHING_MM,
    Channels,
    channels,
    measure_quality,
    perturb_labels,
    register,
    require_good,
)
from gyriflow.io.registrations import (
    WeeklyShapes,
    read_correspondence,
    read_weekly_shapes,
    write_correspondence,
    write_weekly_shapes,
)

ATLAS = sphere()
STRETCH = np.array([1.2, 1.1, 1.0])
GROWN = MatchedSurfaces(ATLAS, ATLAS.vertices * STRETCH)
TURN = rigid(10, 20, 150)[:3, :3]
BALL = ellipsoid_mesh(10, (10.0, 10.0, 10.0))
GRID = scaling(4.0, -30.0)


def own_surface() -> TriangleMesh:
    """Return another mesh of the same brain."""
    ball = sphere(10.1, 3)
    return TriangleMesh(
        ball.vertices @ np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1.0]]),
        ball.faces,
    )


def test_surfaces_are_matched_whatever_the_order_of_their_triangles():
    later = TriangleMesh(GROWN.second, ATLAS.faces[::-1, [1, 2, 0]])
    found, report = match_surfaces(flipped(ATLAS), flipped(later))
    assert np.array_equal(found.second, GROWN.second)
    assert outward(found.first) is found.first
    assert report["vertices"] == len(ATLAS.vertices)
    assert report["turn_deg"] == pytest.approx(0, abs=1e-3)
    assert 0 < report["scatter"] < 0.1
    assert report["area_ratio"] == pytest.approx(1.21, abs=0.01)


def test_numbers_of_matched_surfaces_do_not_depend_on_their_triangles():
    reports = []
    for ball in (sphere(10.0, 5), uneven(sphere(10.0, 5))):
        # the lower half grows, is turned and bent
        down = np.clip(-ball.vertices[:, 2:] / 10, 0, 1)
        bent = ball.vertices * (1 + 0.3 * down) + 3.0 * down**2 * [1.0, 0.0, 0.0]
        second = TriangleMesh(transform_points(bent, FAR[0]), ball.faces)
        near = transform_points(second.vertices, rigid(0.0, 0.0, -20.0))
        reports.append(match_surfaces(ball, TriangleMesh(near, ball.faces))[1])
    even, other = reports
    assert 8.0 < even["turn_deg"] < 20.0
    assert even["scatter"] > 0.05
    for name in ("turn_deg", "scatter", "area_ratio"):
        assert other[name] == pytest.approx(even[name], rel=0.02), name


def test_other_triangles_and_other_places_are_refused():
    with pytest.raises(
        InputError, check=Facts(642, 1280, 2562, 5120, "growth.matched_surfaces")
    ):
        match_surfaces(ATLAS, sphere(subdivisions=3))
    wrong = ATLAS.faces.copy()
    wrong[0] = wrong[0, 0], wrong[0, 1], wrong[400, 2]
    with pytest.raises(InputError, check=Facts(2562, 5120, "growth.matched_surfaces")):
        match_surfaces(ATLAS, TriangleMesh(GROWN.second, wrong))
    shuffled = np.random.default_rng(0).permutation(GROWN.second)
    with pytest.raises(InputError, check=Facts("129°", 1.39, "30°", 0.3)):
        match_surfaces(ATLAS, TriangleMesh(shuffled, ATLAS.faces))
    with pytest.raises(InputError, check=Facts("149°", "30°")):
        match_surfaces(ATLAS, TriangleMesh(GROWN.second @ TURN.T, ATLAS.faces))


def test_another_mesh_of_the_brain_goes_along_in_any_pose():
    own = own_surface()
    turned = MatchedSurfaces(ATLAS, GROWN.second @ TURN.T + [5.0, 0, 0])
    back = MatchedSurfaces(TriangleMesh(turned.second, ATLAS.faces), GROWN.second)
    found = follow_surfaces(own, [turned, back])
    assert found[0] == pytest.approx(own.vertices)
    assert found[1] == pytest.approx(
        own.vertices * STRETCH @ TURN.T + [5.0, 0, 0], abs=0.05
    )
    assert found[2] == pytest.approx(own.vertices * STRETCH, abs=0.05)
    assert np.array_equal(carry_surface(own, [turned, back]), found[2])
    assert carry_surface(own, []) is own.vertices
    with pytest.raises(InputError, check=Facts("5.16 mm", "2 mm")):
        follow_surfaces(TriangleMesh(own.vertices * 1.5, own.faces), [turned])


@pytest.mark.parametrize(("turn_deg", "is_refused"), [(29.5, False), (30.5, True)])
def test_matched_surfaces_may_be_turned_by_30_degrees(turn_deg, is_refused):
    turned = TriangleMesh(ATLAS.vertices @ rigid(0, turn_deg, 0)[:3, :3], ATLAS.faces)
    if is_refused:
        with pytest.raises(InputError, check=Facts("30°")):
            match_surfaces(ATLAS, turned)
    else:
        _, report = match_surfaces(ATLAS, turned)
        assert report["turn_deg"] == pytest.approx(turn_deg, abs=1e-3)


@pytest.mark.parametrize(("mm", "is_refused"), [(1.9, False), (2.1, True)])
def test_a_surface_may_lie_2_mm_from_the_matched_one(mm, is_refused):
    own = sphere(10.0 + mm, 3)
    if is_refused:
        with pytest.raises(InputError, check=Facts("2 mm")):
            follow_surfaces(own, [GROWN])
    else:
        follow_surfaces(own, [GROWN])


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({}, None),
        ({"dice_cerebrum": 0.949}, ["cerebrum", 0.949, 0.95]),
        ({"dice_cortex": 0.599}, ["cortex", 0.599, 0.6]),
        ({"folded_share": 0.0051}, ["0.51%", "0.50%"]),
        # without cortex
        ({"dice_cortex": float("nan")}, None),
    ],
)
def test_a_registration_is_good_within_its_limits(change, facts, caplog):
    quality = {"dice_cerebrum": 0.951, "dice_cortex": 0.601, "folded_share": 0.0049}
    quality |= change
    if facts is None:
        require_good(quality, pair="21-22")
    else:
        with pytest.raises(InputError, check=Facts("21-22", *facts)):
            require_good(quality, pair="21-22")
    require_good(quality, pair="21-22", only_warn=True)
    assert caplog.messages == ([] if facts is None else [Facts("21-22", *facts)])


def test_regions_are_carried_along_matched_surfaces():
    own, later = own_surface(), transformed(own_surface(), np.diag([*STRETCH, 1.0]))
    found = carry_regions((own.vertices[:, 0] > 0).astype(int), own, later, GROWN)
    clear = np.abs(later.vertices[:, 0]) > 1.0
    assert np.array_equal(found[clear], (later.vertices[clear, 0] > 0).astype(int))


def test_matched_surfaces_are_read_as_written(tmp_path):
    write_correspondence(tmp_path / "a.h5", GROWN, {"vertices": 3})
    read = read_correspondence(tmp_path / "a.h5")
    assert isinstance(read, MatchedSurfaces)
    assert np.array_equal(read.first.vertices, ATLAS.vertices)
    assert np.array_equal(read.first.faces, ATLAS.faces)
    assert np.array_equal(read.second, GROWN.second)
    with pytest.raises(ValueError, match=r"2562 .*2561"):
        MatchedSurfaces(ATLAS, GROWN.second[1:])


def test_carried_meshes_are_read_as_written(tmp_path):
    solid = ellipsoid_mesh(4, (10.0, 10.0, 10.0))
    carried = WeeklyShapes(
        np.array([21.0, 22.5]), np.stack([solid.vertices, 1.1 * solid.vertices])
    )
    write_weekly_shapes(tmp_path / "carried.h5", carried)
    read = read_weekly_shapes(tmp_path / "carried.h5")
    assert read.weeks.tolist() == [21.0, 22.5]
    assert read.positions == pytest.approx(carried.positions, abs=1e-5)
    assert [read.index(week) for week in (21.0, 22.5)] == [0, 1]
    with pytest.raises(InputError, check=Facts("22 GW", "21, 22.5 GW")):
        read.index(22.0)
    (tmp_path / "torn.h5").write_bytes(b"torn")
    with pytest.raises(InputError, check=Facts(tmp_path / "torn.h5")):
        read_weekly_shapes(tmp_path / "torn.h5")


# along deformations


def affine_map(matrix: np.ndarray) -> Deformation:
    return Deformation(matrix, np.zeros((16, 16, 16, 3)), GRID)


def test_points_are_carried_in_turn():
    chain = [affine_map(scaling(1.1, (1, 0, 0))), affine_map(scaling(1.2))]
    positions = carry_over_weeks(BALL.vertices, chain)
    assert positions.shape == (3, len(BALL.vertices), 3)
    assert positions[2] == pytest.approx(1.2 * (1.1 * BALL.vertices + [1, 0, 0]))
    with pytest.raises(InputError, check=Facts(1, 2, len(BALL.vertices), "40 mm")):
        carry_over_weeks(BALL.vertices + [60.0, 0, 0], chain)


def test_maps_come_to_the_vertices_of_a_template():
    """A brain that is the template bent and turned, with other triangles; its maps are
    functions of the place."""
    points = np.stack(
        np.meshgrid(*[np.arange(16) * 4.0 - 30.0] * 3, indexing="ij"), axis=-1
    )
    bend = 1.5 * np.sin(points[..., [1, 2, 0]] / 8.0)
    between = Deformation(rigid(0, 0, 25, shift=(5, 0, -3)), bend, GRID)
    template, other = sphere(subdivisions=3), sphere(subdivisions=5)
    brain = TriangleMesh(carry(between, other.vertices), other.faces)

    def waves(places):
        return np.sin(places[:, 0] / 4.0) + places[:, 2] / 10.0

    maps = {
        "waves": waves(brain.vertices),
        "half": (brain.vertices[:, 1] > 0).astype(float),
    }
    found = maps_on_template(maps, brain, template, [between])
    places = carry(between, template.vertices)
    assert found["waves"] == pytest.approx(waves(places), abs=0.01)
    clear = np.abs(places[:, 1]) > 0.5
    assert (found["half"] == (places[:, 1] > 0))[clear].all()
    assert set(found["half"]) == {0, 1}
    assert found["template_distance_mm"].max() < 0.05
    # of the template itself, which needs no registration
    assert maps_on_template({"x": brain.vertices[:, 0]}, brain, brain, [])[
        "x"
    ] == pytest.approx(brain.vertices[:, 0])
    with pytest.raises(InputError, check=Facts(642, "40 mm")):
        maps_on_template(
            maps, brain, transformed(template, scaling(1, (60, 0, 0))), [between]
        )


VOXEL, COARSE = 1.0, 2.0
CORTEX, WHITE, OTHER = 2, 1, 7


def grown(points: np.ndarray) -> np.ndarray:
    """Return where points of the earlier phantom are in the later one: larger, longer
    in front, bent, moved."""
    x, _, z = points.T
    out = points * [1.10, 1.14, 1.08]
    out[:, 0] += 2.0 * np.sin(z / 4)
    out[:, 1] += 1.5 * np.sin(x / 10)
    return out + [4.0, -3.0, 2.0]


def not_grown(points: np.ndarray) -> np.ndarray:
    out = points - [4.0, -3.0, 2.0]
    z = out[:, 2] / 1.08
    x = (out[:, 0] - 2.0 * np.sin(z / 4)) / 1.10
    return np.stack([x, (out[:, 1] - 1.5 * np.sin(x / 10)) / 1.14, z], axis=1)


def beyond_rim(points: np.ndarray) -> np.ndarray:
    """Return how far points are outside an egg with a bump on the right and a dent on
    the left, in its radii."""
    x, y, z = points.T
    angle = np.arctan2(y, x)
    radius = np.sqrt((x / 16) ** 2 + (y / 22) ** 2 + (z / 14) ** 2)
    return radius - (
        1.0 + 0.12 * np.cos(angle) + 0.08 * np.sin(3 * angle) + 0.05 * z / 14
    )


def phantom(points: np.ndarray) -> np.ndarray:
    """Return the labels at points: the egg with a cortex of 3 mm."""
    labels = np.where(beyond_rim(points) < 0, CORTEX, 0)
    return np.where(beyond_rim(points) < -0.18, WHITE, labels)


def volume(affine: np.ndarray, *, later: bool, shape=(66, 78, 66)) -> np.ndarray:
    points = transform_points(np.indices(shape).reshape(3, -1).T, affine)
    return phantom(not_grown(points) if later else points).reshape(shape)


def centred(
    shape=(66, 78, 66),
    turn: np.ndarray | None = None,
    at=(0.0, 0.0, 0.0),
    voxel=VOXEL,
) -> np.ndarray:
    affine = np.eye(4)
    affine[:3, :3] = voxel * (np.eye(3) if turn is None else turn)
    affine[:3, 3] = at - affine[:3, :3] @ ((np.array(shape) - 1) / 2)
    return affine


def made(affine: np.ndarray, *, later: bool) -> Channels:
    return channels(
        volume(affine, later=later), affine, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,)
    )


@pytest.fixture(scope="module")
def pair() -> tuple[Channels, Channels]:
    # the later volume is stored with its axes in another order, one of them backwards
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return made(centred(), later=False), made(
        centred(turn=turned, at=(4.0, -3.0, 2.0)), later=True
    )


@pytest.fixture(scope="module")
def found(pair):
    return register(*pair)


COARSE_SHAPE = (33, 39, 33)


@pytest.fixture(scope="module")
def coarse() -> tuple[np.ndarray, np.ndarray]:
    """The labels of the earlier phantom in voxels of 2 mm, and their affine."""
    affine = centred(COARSE_SHAPE, voxel=COARSE)
    return volume(affine, later=False, shape=COARSE_SHAPE), affine


@pytest.fixture(scope="module")
def coarse_brain(coarse) -> Channels:
    return channels(*coarse, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,))


RIM_MM = 17.0
"""Mean radius of the phantom."""


def rim_errors(carried_points: np.ndarray) -> np.ndarray:
    """Return how far points of the earlier brain's rim end from the later brain's rim,
    in mm.

    Along the rim, and inside, the phantom is all alike, and shows no one where it went.
    """
    return RIM_MM * np.abs(beyond_rim(not_grown(carried_points)))


def rim_points(brain: Channels) -> np.ndarray:
    grid = transform_points(
        np.indices(brain.tissue.shape).reshape(3, -1).T, brain.affine
    )
    return grid[np.abs(beyond_rim(grid)) < 0.02]


def test_the_rim_comes_to_where_it_grew(pair, found):
    points = rim_points(pair[0])
    errors = rim_errors(carry(found.deformation, points))
    by_affine = rim_errors(transform_points(points, found.deformation.matrix))
    assert errors.mean() < 0.4 * VOXEL
    assert errors.mean() < 0.6 * by_affine.mean()
    assert found.turned_deg == 0


def test_quality_of_a_good_registration(pair, found):
    quality = measure_quality(*pair, found.deformation)
    assert quality["dice_cerebrum"] > 0.97
    assert quality["dice_cortex"] > 0.85
    assert quality["folded_share"] == 0
    assert quality["volume_ratio"] == pytest.approx(1.10 * 1.14 * 1.08, rel=0.05)
    require_good(quality, pair="21-22")


def test_a_brain_in_another_pose_is_turned_first(coarse_brain):
    affine = centred(COARSE_SHAPE, at=(4.0, -3.0, 2.0), voxel=COARSE)
    labels = volume(affine, later=True, shape=COARSE_SHAPE)
    later = channels(labels, LPS @ affine, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,))
    found = register(coarse_brain, later)
    assert found.turned_deg == pytest.approx(180)
    turned_back = carry(found.deformation, rim_points(coarse_brain)) @ LPS[:3, :3]
    assert rim_errors(turned_back).mean() < 0.4 * COARSE


def test_perturbed_labels_differ_at_boundaries_only_and_by_their_seed():
    labels = np.zeros((40, 40, 40), np.uint8)
    labels[8:32, 8:32, 8:32] = 2
    labels[14:26, 14:26, 14:26] = 7
    one, again = perturb_labels(labels, 1, "a"), perturb_labels(labels, 1, "a")
    assert np.array_equal(one, again)
    # errors of two brains, or of two members, are independent
    for other in (perturb_labels(labels, 2, "a"), perturb_labels(labels, 1, "b")):
        assert (
            abs(np.corrcoef((one != labels).ravel(), (other != labels).ravel())[0, 1])
            < 0.5
        )
    assert set(np.unique(one)) == {0, 2, 7}
    near = binary_dilation(morphological_gradient(labels, 3) > 0, iterations=2)
    assert np.array_equal(one[~near], labels[~near])
    assert 0.02 < (one != labels)[near].mean() < 0.2


def test_a_failed_registration_is_refused_with_numbers(pair):
    none = Deformation(np.eye(4), np.zeros((*pair[0].tissue.shape, 3)), pair[0].affine)
    quality = measure_quality(*pair, none)
    with pytest.raises(
        InputError, match=r"0\.7\d+ .*0\.2\d+ ", check=Facts("week 21 to 22", 0.95, 0.6)
    ):
        require_good(quality, pair="week 21 to 22")


def test_a_map_that_folds_is_refused(pair, found):
    displacement = found.deformation.displacement.copy()
    displacement[22:25] += [8.0, 0.0, 0.0]
    folded = Deformation(
        found.deformation.matrix, displacement, found.deformation.affine
    )
    quality = measure_quality(*pair, folded)
    assert quality["least_determinant"] < 0
    assert quality["folded_share"] > 0.005
    with pytest.raises(InputError, check=Facts("21-22", "9.37%", "0.50%")):
        require_good(quality, pair="21-22")


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("is_first", [True, False])
def test_a_cerebrum_at_the_edge_of_the_volume_is_refused(axis, is_first):
    labels = np.zeros((20, 22, 24), np.uint8)
    labels[6:14, 6:14, 6:14] = WHITE
    channels(labels, np.eye(4), cerebrum=(WHITE,))
    at_end = np.roll(labels, -6 if is_first else labels.shape[axis] - 14, axis)
    place = f"{'ijk'[axis]} = {0 if is_first else 'last'}"
    with pytest.raises(InputError, check=Facts("64 voxels", place)):
        channels(at_end, np.eye(4), cerebrum=(WHITE,))


@pytest.mark.parametrize("voxel_mm", [None, 0.9])
def test_channels_of_long_turned_voxels_lie_where_the_brain_is_smoothed_alike(voxel_mm):
    half_mm = np.array([7.0, 9.0, 6.0])
    shape = np.array([34, 32, 20])
    affine = FAR[1] @ scaling(LONG_MM)
    centre = transform_points((shape - 1) / 2, affine)
    index = np.indices(shape).reshape(3, -1).T
    from_centre = (transform_points(index, affine) - centre) @ FAR[1][:3, :3]
    radius = np.linalg.norm(from_centre / half_mm, axis=1).reshape(shape)
    labels = np.where(radius < 0.7, WHITE, np.where(radius < 1.0, CORTEX, 0))
    found = channels(
        labels, affine, cerebrum=(WHITE, CORTEX), cortex=(CORTEX,), voxel_mm=voxel_mm
    )
    voxel = voxel_mm or 0.5
    assert found.affine[:3, :3] == pytest.approx(voxel * np.eye(3))
    places = transform_points(
        np.indices(found.tissue.shape).reshape(3, -1).T, found.affine
    )
    widths = []
    for bit, field, share in (
        (1, found.cerebrum, 1.0),
        (2, found.cortex, 1 - 0.7**3),
    ):
        solid = (found.tissue & bit > 0).ravel()
        volume_mm3 = 4 / 3 * np.pi * half_mm.prod() * share
        assert solid.sum() * voxel**3 == pytest.approx(volume_mm3, rel=0.03)
        assert places[solid].mean(axis=0) == pytest.approx(centre, abs=0.1)
        # the variance that smoothing adds, along each axis of the voxels
        along = (places - centre) @ FAR[1][:3, :3]
        widths.append(
            np.average(along**2, axis=0, weights=field.ravel())
            - (along[solid] ** 2).mean(axis=0)
        )
    if voxel_mm is None:
        # interpolation in larger voxels smooths further
        assert widths[0] == pytest.approx(SMOOTHING_MM**2, abs=0.15)
        assert widths[1] == pytest.approx(SMOOTHING_MM**2, abs=0.3)
    margins = np.minimum(places[solid].min(axis=0) - places.min(axis=0), 99)
    assert margins.min() > MARGIN_MM - 2 * voxel
    assert (
        places.max(axis=0) - places[solid].max(axis=0)
    ).min() > MARGIN_MM - 2 * voxel


def test_the_quality_of_a_registration_is_that_of_its_map_inside_the_brain(
    coarse_brain,
):
    # growth by a quarter along x, more in front, and a shift by 3 mm at the rim
    index = np.moveaxis(np.indices((12, 14, 13)), 0, -1)
    affine = scaling(6.0, (-33.0, -39.0, -36.0))
    points = transform_points(index.reshape(-1, 3), affine).reshape(index.shape)
    x, y, _ = np.moveaxis(points, -1, 0)
    displacement = np.zeros(index.shape)
    displacement[..., 0] = x * np.where(y > 0, 0.5, 0.25)
    deformation = Deformation(scaling(1.1), displacement, affine)
    found = measure_quality(coarse_brain, coarse_brain, deformation)
    grid = np.indices(coarse_brain.tissue.shape).reshape(3, -1).T
    inside = (coarse_brain.tissue & 1 > 0).ravel()
    places = transform_points(grid[inside], coarse_brain.affine)
    is_front = places[:, 1] > 0
    factors = 1.1**3 * np.where(is_front, 1.5, 1.25)
    assert found["volume_ratio"] == pytest.approx(factors.mean(), rel=0.02)
    assert found["log_growth_sd"] == pytest.approx(np.log(factors).std(), rel=0.2)
    assert found["least_determinant"] == pytest.approx(1.1**3 * 1.25, rel=0.02)
    assert found["folded_share"] == 0
    moved_mm = np.abs(places[:, 0]) * np.where(is_front, 0.5, 0.25)
    assert found["inside_mm"] == pytest.approx(np.quantile(moved_mm, 0.95), rel=0.1)
    # most of the rim is as far from x = 0 as the volume reaches
    assert found["rim_mm"] == pytest.approx(0.5 * 33.0, rel=0.1)


def test_images_are_compared_where_both_brains_have_one(coarse, coarse_brain):
    labels, affine = coarse
    image = 700.0 * gaussian_filter((labels > 0).astype(float), 1)
    shown = channels(labels, affine, cerebrum=(WHITE, CORTEX), image=(image, affine))
    assert shown.cortex is None
    assert np.quantile(shown.intensity[shown.tissue > 0], 0.99) == pytest.approx(
        1.0, abs=0.01
    )
    with pytest.raises(InputError, check=Facts("0%", "99 %", 0)):
        channels(
            labels,
            affine,
            cerebrum=(WHITE, CORTEX),
            image=(np.zeros_like(image), affine),
        )
    found = register(replace(shown, cortex=coarse_brain.cortex), coarse_brain)
    assert found.channels == ("cerebrum", "cortex")


def test_deformations_are_read_as_written(tmp_path, found):
    write_correspondence(tmp_path / "a.h5", found.deformation, {"dice": 0.9})
    read = read_correspondence(tmp_path / "a.h5")
    assert np.array_equal(read.matrix, found.deformation.matrix)
    assert read.displacement == pytest.approx(found.deformation.displacement, abs=1e-6)
    (tmp_path / "b.h5").write_bytes(b"torn")
    with pytest.raises(InputError, check=Facts(tmp_path / "b.h5")):
        read_correspondence(tmp_path / "b.h5")
