"""What is to be expected of a brain: surfaces met sharply, and growth carried through a
known map."""

import numpy as np
import pytest
from facts import Facts
from scipy.spatial.transform import Rotation
from shapes import ellipsoid, ellipsoid_mesh, rigid, scaling, sphere

from gyriflow.errors import InputError
from gyriflow.folding.elastic_fit import ElasticFit
from gyriflow.folding.stretches import deformation_gradients, log_stretch
from gyriflow.geometry.alignment import align_points
from gyriflow.geometry.deformations import (
    Deformation,
    MatchedSurfaces,
    transform_points,
)
from gyriflow.geometry.diffusion import vertex_sizes
from gyriflow.geometry.jacobians import SLOPES
from gyriflow.geometry.matching import nearest_on
from gyriflow.geometry.tetrahedra import (
    TetrahedralMesh,
    boundary_surface,
    linear_pieces,
    volumes_between,
)
from gyriflow.geometry.triangles import TriangleMesh, signed_volume
from gyriflow.growth.atlas_path import AtlasPath
from gyriflow.growth.expected import (
    LASTING_GW,
    WHOLE,
    Persistence,
    expected_positions,
    place_in_atlas,
    predict_shapes,
)
from gyriflow.growth.series_shapes import (
    SeriesShapes,
    fit_onto_surface,
    follow_series,
    sizes_of,
)

BALL = ellipsoid_mesh(6, (20.0, 20.0, 20.0))
WEEKS = [22.0, 23.0, 24.0]


def wavy(height_mm):
    """Return a sphere with waves of a height in mm."""
    ball = sphere(20.0, 3)
    x, y, z = (ball.vertices / 20.0).T
    wave = np.sin(9 * x) * np.cos(8 * y + 1) + np.sin(8 * z + 2) * np.cos(7 * x)
    radius = 1 + height_mm * wave / 20
    return TriangleMesh(ball.vertices * radius[:, None], ball.faces)


def test_needles_do_not_throw_vertices_off_the_surface():
    # turned about its axis, more and more: faces have angles of almost 180°
    ball = sphere(20.0, 3)
    x, y, z = ball.vertices.T
    turn = np.exp(0.8j * z) * (x + 1j * y)
    twisted = TriangleMesh(np.stack([turn.real, turn.imag, z], axis=1), ball.faces)
    larger = sphere(21.0, 3)
    is_upper = larger.vertices[larger.faces].mean(axis=1)[:, 2] > 0
    half = TriangleMesh(larger.vertices, larger.faces[is_upper])
    moves = fit_onto_surface(twisted, half) - twisted.vertices
    assert np.linalg.norm(moves, axis=1).max() < 15


def affine_map(matrix):
    """Return a registration that knows nothing of folds."""
    return Deformation(matrix, np.zeros((13, 13, 13, 3)), scaling(10.0, -60.0))


INNER = sphere(19.5)
LARGER = TriangleMesh(1.1 * INNER.vertices, INNER.faces)
MATCHED = [
    MatchedSurfaces(INNER, LARGER.vertices),
    MatchedSurfaces(LARGER, 1.3 * INNER.vertices),
]


@pytest.mark.parametrize(
    ("pairs", "surfaces", "makes_body"),
    [
        ([affine_map(np.eye(4))] * 2, [wavy(0.3), wavy(0.6)], True),
        (MATCHED, [], False),
    ],
)
def test_an_interrupted_series_goes_on_from_its_last_week(pairs, surfaces, makes_body):
    def follow(pairs, **more):
        body = ElasticFit(BALL) if makes_body else None
        return follow_series(BALL, WEEKS, pairs, surfaces, body, **more)

    states = []
    whole = follow(pairs, after_week=states.append)
    assert [state.weeks for state in states] == [[22.0, 23.0], WEEKS]
    # the first registration is not used again
    left = pairs if pairs is MATCHED else [None, pairs[1]]
    again = follow(left, earlier=states[0])
    assert again.weeks == whole.weeks
    assert np.array_equal(again.positions[:2], states[0].positions)
    assert again.positions[2] == pytest.approx(whole.positions[2], abs=0.05)
    assert np.abs(whole.positions[2] - whole.positions[1]).max() > 0.2


def without_pose(found, wanted):
    sizes = vertex_sizes(BALL.vertices, linear_pieces(BALL))
    return np.abs(align_points(found, wanted, sizes) - wanted).max()


def test_a_brain_that_is_the_atlas_ends_as_the_atlas_in_its_own_pose():
    x, y, z = BALL.vertices.T
    wave = np.stack([0.6 * np.sin(y / 9), 0.5 * np.sin(z / 8), 0 * x], axis=1)
    atlas, posed = [], []
    for week in WEEKS:
        growth = BALL.vertices * [0.05, 0.08, 0.06] + wave
        atlas.append(BALL.vertices + (week - 22) * growth)
        pose = rigid(5 * week, -3 * week, 40, shift=(week, -20.0, 7.0))
        posed.append(transform_points(atlas[-1], pose))
    found = expected_positions(BALL, 22.0, np.stack(posed), WEEKS, WEEKS[1:]).positions
    assert found[0] == pytest.approx(BALL.vertices)
    for places, wanted in zip(found, atlas, strict=True):
        assert without_pose(places, wanted) < 1e-6
    assert np.abs(found[2] - atlas[2]).max() < 1.5


def test_a_brain_between_two_weeks_has_gone_a_part_of_the_way():
    places = BALL.vertices * [1.0, 1.2, 0.9]
    atlas = np.stack([places * (1 + 0.1 * (week - 22)) for week in WEEKS])
    start = TetrahedralMesh(places * 1.04, BALL.tets)
    found = expected_positions(start, 22.4, atlas, WEEKS, [23.0, 23.5, 24.0])
    for positions, factor in zip(found.positions[1:], (1.1, 1.15, 1.2), strict=True):
        assert without_pose(positions, places * factor) < 1e-6
    # as of the week before it would be a brain too large, all its life
    early = expected_positions(
        start, 22.0, atlas, WEEKS, [24.0], smoothing_mm=0, keep_all=True
    )
    assert early.positions[-1] == pytest.approx(1.04 * 1.2 * places, abs=1e-6)


@pytest.mark.parametrize("week", [20.9, 24.0, 25.0])
def test_a_brain_before_or_after_the_atlas_is_refused(week):
    atlas = np.stack([BALL.vertices] * 3)
    with pytest.raises(InputError, check=Facts(f"{week:g} GW", "22 to 24 GW", "21 GW")):
        expected_positions(BALL, week, atlas, WEEKS, [26.0])
    expected_positions(BALL, 21.0, atlas, WEEKS, WEEKS)


KNOWN = Persistence(0.6, 0.4, match_error_mm=0.3)
"""Three quarters of its mean square are real, of which 0.4 last."""
LASTING_8 = 0.4 + 0.6 * np.exp(-8 / LASTING_GW)


@pytest.mark.parametrize(
    ("persistence", "weeks", "weight"),
    [
        (KNOWN, 0.0, 1.0),
        (KNOWN, 1000.0, 0.75 * 0.4),
        (KNOWN, 8.0, LASTING_8 * (0.75 + 0.25 * np.exp(-8.0))),
        # no error of the match, and a difference smaller than it
        (Persistence(0.2, 0.4, match_error_mm=0.0), 8.0, LASTING_8),
        (Persistence(0.2), 1000.0, 0.0),
        (WHOLE, 12.0, 1.0),
    ],
)
def test_persistence_is_reliability_times_what_lasts(persistence, weeks, weight):
    assert persistence.weight(weeks) == pytest.approx(weight)


def sampled(moved, points, spacing_mm=3.0):
    """Return a map of space as a registration knows it, on a grid round points."""
    low = points.min(axis=0) - 6.0
    shape = np.ceil((np.ptp(points, axis=0) + 12.0) / spacing_mm).astype(int) + 1
    grid = scaling(spacing_mm, low)
    at = transform_points(np.indices(shape).reshape(3, -1).T, grid)
    return Deformation(np.eye(4), (moved(at) - at).reshape(*shape, 3), grid)


def to_atlas(points):
    """Return the atlas' place of each point of a brain: turned, stretched and bent."""
    angles = np.radians(30.0 + 4.0 * points[:, 2:] / 30.0)
    turned = Rotation.from_rotvec(angles * [0.0, 0.0, 1.0]).apply(points)
    return turned * [1.05, 0.98, 1.02] + 0.4 * np.sin(points[:, [1, 2, 0]] / 20.0)


def grown_atlas(points):
    """Grow faster where y is positive, and along x."""
    growth = np.array([[0.08, 0.02, 0.0], [0.02, -0.02, 0.0], [0.0, 0.0, 0.03]])
    return points + points @ growth * (1 + 0.3 * np.sin(points[:, 1:2] / 15.0))


def test_growth_comes_through_registrations_of_a_known_map_in_the_whole_body():
    """Growth of an atlas, carried by registrations to a brain that a known map makes
    from it, is correct to 5 % if the whole individual difference is kept.

    Differences removed by the default smoothing of 8 mm, among them a part of a
    difference in size, return to the atlas.
    """
    axes = (30.0, 36.0, 27.0)
    mesh, fine = ellipsoid_mesh(8, axes), ellipsoid(axes, 4)
    first = to_atlas(fine.vertices)
    surfaces = [TriangleMesh(at, fine.faces) for at in (first, grown_atlas(first))]
    pairs = [sampled(to_atlas, fine.vertices), sampled(grown_atlas, first)]
    atlas = follow_series(mesh, [21.0, 22.0, 23.0], pairs, surfaces).positions[1:]

    def gradients(before, after):
        return deformation_gradients(before, after, mesh.tets, SLOPES[None])[:, 0]

    def size(parts):
        volumes = volumes_between(mesh.vertices, mesh.tets)
        return np.average(np.linalg.norm(parts, axis=(1, 2)), weights=volumes)

    # the growth of the atlas, turned back as the map turns each element
    places = to_atlas(mesh.vertices)
    known = log_stretch(gradients(places, grown_atlas(places)))
    u, _, vt = np.linalg.svd(gradients(mesh.vertices, places))
    turn = u @ vt
    wanted = np.swapaxes(turn, 1, 2) @ known @ turn
    # without this it would be wrong by far more than what is allowed
    assert size(known - wanted) > 0.5 * size(wanted)
    weeks = [22.0, 23.0]
    for smoothing_mm, least, largest in ((0.0, 0.0, 0.05), (8.0, 0.05, 0.1)):
        options = {"smoothing_mm": smoothing_mm, "keep_all": True}
        found = expected_positions(mesh, 22.0, atlas, weeks, weeks[1:], **options)
        growth = log_stretch(gradients(mesh.vertices, found.positions[1]))
        error = size(growth - wanted)
        assert least * size(wanted) <= error < largest * size(wanted)


def uneven(places, week):
    """Grow unevenly, by a tenth a week and more along y, and turn by 40 degrees a
    week."""
    turn = rigid(0, 0, 40 * (week - 22))[:3, :3]
    return (places * (1 + np.array([0.08, 0.12, 0.1]) * (week - 22))) @ turn.T


def path_of(weeks):
    """Return the path of an atlas whose brain is the ball, at other vertices, that
    grows and turns from week to week."""
    mesh = ellipsoid_mesh(6, (20.0, 20.0, 20.0))
    shapes = np.stack([uneven(mesh.vertices, week) for week in weeks])
    return AtlasPath(mesh.tets, SeriesShapes(list(weeks), shapes, []))


def test_points_inside_and_outside_an_atlas_that_grows_and_turns_keep_their_places():
    path = path_of(WEEKS)
    points = np.random.default_rng(4).normal(size=(100, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    inside = 12.0 * points
    # as seen from the second week
    carried = path.carry(uneven(inside, 23.0), 23.0)
    for found, week in zip(carried, WEEKS, strict=True):
        assert found == pytest.approx(uneven(inside, week), abs=1e-6)
    # those outside keep their distance from the surface
    distances = []
    for week, places in zip(WEEKS, path.carry(22.0 * points, 22.0), strict=True):
        surface, _ = boundary_surface(path.mesh(week))
        distances.append(nearest_on(places, surface)[0])
    assert distances[0].min() > 0.9
    np.testing.assert_allclose(distances[1:], [distances[0]] * 2, atol=0.2)


@pytest.fixture(scope="module")
def predict():
    """Return a function that predicts a ball 5 % larger than the atlas at 22.3 GW, to
    an end week.

    The ball may be called that of another week.
    """
    path = path_of([21.0, 22.0, 23.0, 24.0, 25.0, 26.0])
    ball = ellipsoid_mesh(5, (20.0, 20.0, 20.0))
    start = TetrahedralMesh(1.05 * uneven(ball.vertices, 22.3), ball.tets)
    pair = affine_map(rigid(0, 0, -12) @ scaling(1 / 1.05))
    inside = place_in_atlas(start, pair, path.mesh(22.0), ElasticFit)

    def predict(end_week, start_week=22.3, **options):
        weeks = start_week, end_week
        return predict_shapes(start, *weeks, path, inside, 22.0, ElasticFit, **options)

    return predict


def test_a_prediction_does_not_depend_on_the_end_week_or_further_weeks(predict):
    whole = predict(26.0, further_weeks=[23.4, 24.6])
    shapes = dict(zip(whole.weeks, whole.positions, strict=True))
    for end_week, further in ((23.5, []), (24.0, [23.4]), (25.2, [25.0])):
        part = predict(end_week, further_weeks=further)
        for week, positions in zip(part.weeks, part.positions, strict=True):
            assert positions == pytest.approx(shapes[week], abs=1e-9)
    assert whole.between == [23.4, 24.6]


def test_a_brain_that_stays_away_from_its_expected_shape_is_warned_of(
    predict, monkeypatch, caplog
):
    predict(23.5)
    assert "stays" not in caplog.text
    monkeypatch.setattr(ElasticFit, "move_to", lambda body, shape: body.positions_mm)
    predict(23.5)
    assert "at most, at GW 23, the brain stays" in caplog.text
    assert caplog.text.count("stays") == 1


def test_a_brain_that_is_older_than_stated_grows_as_one_of_that_age(predict):
    shifted = predict(24.0, age_shift_gw=0.5).shapes
    older = predict(24.5, start_week=22.8).shapes
    assert np.array(shifted.weeks) + 0.5 == pytest.approx(older.weeks)
    assert shifted.positions == pytest.approx(older.positions, abs=1e-6)


def test_a_brain_larger_than_the_atlas_grows_as_the_atlas_and_stays_larger(predict):
    found = predict(25.0, further_weeks=[24.5], lasting=1.0)
    assert found.shapes.weeks == [22.3, 23.0, 24.0, 25.0, 26.0]
    assert found.weeks == [22.3, 23.0, 24.0, 24.5, 25.0, 26.0]
    ball = ellipsoid_mesh(5, (20.0, 20.0, 20.0))
    volumes = sizes_of(ball, found.positions)["volume_ml"]
    growth = 1 + np.outer(np.array(found.weeks) - 22, [0.08, 0.12, 0.1])
    wanted = growth.prod(axis=1)
    # a part of the difference in size is smoothed away, and a part taken for an error
    assert volumes / volumes[0] == pytest.approx(wanted / wanted[0], rel=0.06)
    assert (volumes_between(found.positions[3], ball.tets) > 0).all()
    faces = boundary_surface(ball)[0].faces
    by_name = {}
    for name, shapes in found.baselines.items():
        surfaces = [TriangleMesh(places, faces) for places in shapes]
        by_name[name] = [signed_volume(surface) / 1e3 for surface in surfaces]
    own, deformed = by_name["atlas"], by_name["atlas_deformed"]
    # the atlas' own brain is smaller by 5 % in each direction, the one with the whole
    # difference is not
    assert deformed == pytest.approx(volumes, rel=0.06)
    assert own[1] / deformed[1] == pytest.approx(1.05**-3, rel=0.03)
