"""Small meshes, surfaces and brains whose geometry is known: the one factory of all
tests."""

from functools import cache

import nibabel as nib
import numpy as np
import trimesh
from nibabel.gifti import GiftiDataArray, GiftiImage
from odd_brains import CEREBRUM, positions
from phantoms import CENTRE_MM, phantom_labels
from scipy.spatial.transform import Rotation

from gyriflow.anatomy.extraction import (
    isosurface,
    make_simple,
    shifted_affine,
    smooth_mask,
)
from gyriflow.geometry.tetrahedra import TetrahedralMesh, boundary_faces, grid
from gyriflow.geometry.triangles import (
    TriangleMesh,
    face_normals,
    flipped,
    submesh,
    transformed,
    vertex_normals,
)

HALF_AXES = np.array([11.0, 24.0, 16.0])
"""Semi-axes in mm of an ellipsoid as large as a small hemisphere of week 21."""

LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
"""The motion from LPS to RAS coordinates, and back."""
LONG_MM = (0.5, 0.7, 1.0)
"""Edges of a voxel that is no cube."""
PAD = 4


def rigid(*degrees, shift=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the (4, 4) motion of turns about x, y and z in turn, in degrees, and a
    shift in mm."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(
        "xyz", degrees or (0.0, 0.0, 0.0), degrees=True
    ).as_matrix()
    matrix[:3, 3] = shift
    return matrix


FAR = (
    rigid(0.0, 0.0, 30.0, shift=(200.0, -180.0, 130.0)),
    rigid(25.0, 0.0, -30.0, shift=(-150.0, 220.0, 140.0)),
)
"""Two poses, each 300 mm from the origin and turned by 30 degrees or more, so that none
stands for the other."""


def scaling(factors, shift=0.0) -> np.ndarray:
    """Return the (4, 4) matrix of one factor or three, and a shift in mm after it: the
    affine of a grid of voxels."""
    matrix = np.eye(4)
    matrix[:3, :3] *= factors
    matrix[:3, 3] = shift
    return matrix


def moved(mesh: TriangleMesh, *shift: float) -> TriangleMesh:
    """Return a surface shifted by mm along x, or x, y and z."""
    return TriangleMesh(mesh.vertices + [*shift, 0.0, 0.0][:3], mesh.faces)


def inner(mesh: TriangleMesh, depth_mm: float) -> TriangleMesh:
    """Return a surface whose vertices are mm further inside along their normals."""
    return TriangleMesh(mesh.vertices - depth_mm * vertex_normals(mesh), mesh.faces)


def sphere(
    radius: float = 10.0, subdivisions: int = 4, centre=(0.0, 0.0, 0.0)
) -> TriangleMesh:
    """Return an icosphere, its radius in mm."""
    return ellipsoid((radius,) * 3, subdivisions, centre)


def ellipsoid(half_axes, subdivisions: int = 4, centre=(0.0, 0.0, 0.0)) -> TriangleMesh:
    """Return an icosphere drawn out to semi-axes in mm."""
    vertices, faces = _icosphere(subdivisions)
    return TriangleMesh(vertices * np.asarray(half_axes) + np.asarray(centre), faces)


def uneven(ball: TriangleMesh, ratio: float = 5.0) -> TriangleMesh:
    """Return a sphere around the origin, its triangles at the bottom wider than those
    at the top by a ratio.

    The map is conformal, so triangles keep their angles. A mean over vertices is not
    one over the area.
    """
    radius = np.linalg.norm(ball.vertices, axis=1)
    x, y, z = (ball.vertices / radius[:, None]).T
    # half the angle from the top, whose tangent is the distance in stereographic
    # coordinates
    half_angle = np.arccos(np.clip(z, -1.0, 1.0)) / 2
    polar = 2 * np.arctan2(np.sin(half_angle), np.sqrt(ratio) * np.cos(half_angle))
    azimuth = np.arctan2(y, x)
    flat = np.sin(polar)
    directions = np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(polar)], axis=1
    )
    return TriangleMesh(radius[:, None] * directions, ball.faces)


@cache
def _icosphere(subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    return np.array(ball.vertices), np.array(ball.faces)


def octasphere(radius: float, subdivisions: int = 5) -> TriangleMesh:
    """Return a sphere made of an octahedron, with edges in the planes x = 0, y = 0 and
    z = 0."""
    shape = trimesh.Trimesh(
        [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]],
        [
            [0, 1, 2],
            [1, 3, 2],
            [3, 4, 2],
            [4, 0, 2],
            [1, 0, 5],
            [3, 1, 5],
            [4, 3, 5],
            [0, 4, 5],
        ],
    )
    for _ in range(subdivisions):
        shape = shape.subdivide()
    return TriangleMesh(
        radius * shape.vertices / np.linalg.norm(shape.vertices, axis=1)[:, None],
        shape.faces,
    )


@cache
def cut_ellipsoid() -> tuple[TriangleMesh, TriangleMesh, TriangleMesh]:
    """Return the open left and right half of an ellipsoid as large as a brain of week
    24, and the left one's wall."""
    ball = octasphere(1.0, 4)
    whole = TriangleMesh(ball.vertices * [22.0, 28.0, 24.0], ball.faces)
    is_left = whole.vertices[whole.faces][:, :, 0].mean(axis=1) < 0.0
    left, right = (submesh(whole, side)[0] for side in (is_left, ~is_left))
    return (
        left,
        right,
        TriangleMesh(left.vertices * [0.0, 1.0, 1.0], left.faces[:, ::-1]),
    )


def hemisphere_with_cut(
    pit_mm: float, radius: float = 25.0, cut: float = 8.0
) -> TriangleMesh:
    """Return half a sphere, closed in the plane x = 0 but for a round cut in a pit so
    deep, or on a neck so high."""
    down = np.linspace(0.0, 0.5 * np.pi, 40)
    flat, wall = np.linspace(radius, cut, 25)[1:], np.linspace(0.0, pit_mm, 5)[1:]
    around = np.concatenate([radius * np.sin(down), flat, np.full(len(wall), cut)])
    along = np.concatenate([radius * np.cos(down), 0 * flat, wall])
    shape = trimesh.creation.revolve(np.column_stack([around, along]), sections=160)
    mesh = TriangleMesh(shape.vertices[:, [2, 0, 1]], shape.faces)
    return mesh if face_normals(mesh)[:, 0].mean() > 0 else flipped(mesh)


def box(size, centre=(0.0, 0.0, 0.0), subdivisions: int = 0) -> TriangleMesh:
    """Return a box's surface, 12 triangles, each divided in four some times."""
    shape = trimesh.creation.box(size)
    for _ in range(subdivisions):
        shape = shape.subdivide()
    return TriangleMesh(shape.vertices + np.asarray(centre), shape.faces)


def sheet(*axes: np.ndarray) -> TriangleMesh:
    """Return an open surface over a grid: the (n, m) x, y and z of its vertices, seen
    from above where these ascend."""
    numbers = np.arange(axes[0].size).reshape(axes[0].shape)
    a, b, c, d = numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    return TriangleMesh(np.stack(axes, axis=-1).reshape(-1, 3), faces)


def torus(ring: float, tube: float, around: int = 32, across: int = 32) -> TriangleMesh:
    """Return a torus about z: the radii in mm of its ring and its tube, and the faces
    along both."""
    shape = trimesh.creation.torus(
        ring, tube, major_sections=around, minor_sections=across
    )
    return TriangleMesh(shape.vertices, shape.faces)


@cache
def phantom(
    week: float = 24.0, voxel_mm: float | tuple[float, float, float] = 1.2
) -> tuple[np.ndarray, np.ndarray]:
    """Return the labels of a synthetic brain and their affine, which are not to be
    changed."""
    labels, affine = phantom_labels(week, voxel_mm=voxel_mm)
    labels.flags.writeable = affine.flags.writeable = False
    return labels, affine


def mask_surface(mask: np.ndarray, affine: np.ndarray) -> TriangleMesh:
    """Return the closed surface of the smoothed main parts of a mask of voxels, without
    handles."""
    field, _ = make_simple(smooth_mask(np.pad(mask, PAD), 1.0))
    return isosurface(field, shifted_affine(affine, np.full(3, -PAD)))


def cerebrum_surface(labels: np.ndarray, affine: np.ndarray) -> TriangleMesh:
    """Return the closed surface around the cerebrum of a phantom's labels."""
    return mask_surface(np.isin(labels, CEREBRUM), affine)


@cache
def phantom_halves(
    week: float = 24.0, voxel_mm: float | tuple[float, float, float] = 1.2
) -> tuple[TriangleMesh, TriangleMesh]:
    """Return a phantom's left and right hemisphere as closed surfaces 1.2 mm apart, the
    fissure at x = 0, in RAS+."""
    labels, affine = phantom(week, voxel_mm)
    centred = affine.copy()
    centred[:3, 3] -= CENTRE_MM
    x, _, _ = positions(labels, affine)
    left, right = (
        mask_surface(np.isin(labels, CEREBRUM) & side, centred)
        for side in (x < -0.6, x > 0.6)
    )
    return left, right


def box_mesh(
    cells: tuple[int, int, int], size: tuple[float, float, float]
) -> TetrahedralMesh:
    """Return a box around the origin, in mm, with six elements per grid cell."""
    return grid(
        [np.linspace(-s / 2, s / 2, n + 1) for s, n in zip(size, cells, strict=True)]
    )


def joined(*parts) -> TetrahedralMesh:
    """Return one mesh of some, each with a shift in mm."""
    vertices = [mesh.vertices + shift for mesh, shift in parts]
    first = np.cumsum([0, *map(len, vertices)])
    tets = [mesh.tets + number for (mesh, _), number in zip(parts, first, strict=False)]
    return TetrahedralMesh(np.concatenate(vertices), np.concatenate(tets))


def waves_on(
    mesh: TetrahedralMesh, semi_axes, height_mm: float, length_mm: float
) -> np.ndarray:
    """Return how far (n, 3) vertices of an ellipsoid move by waves along y, which fade
    inside."""
    radius = np.linalg.norm(mesh.vertices / np.array(semi_axes), axis=1, keepdims=True)
    length = np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    outward = mesh.vertices / np.maximum(length, 1e-6)
    shell = np.exp(-(((1 - radius) / 0.25) ** 2))
    wave = np.cos(2 * np.pi * mesh.vertices[:, 1:2] / length_mm)
    return height_mm * wave * shell * outward


def ellipsoid_mesh(
    cells: int, semi_axes: tuple[float, float, float], centre=(0.0, 0.0, 0.0)
) -> TetrahedralMesh:
    """Return an ellipsoid in mm: a cube's grid with its shells drawn out to
    ellipsoids."""
    cube = box_mesh((cells,) * 3, (2.0, 2.0, 2.0))
    x = cube.vertices
    shell = np.abs(x).max(axis=1, keepdims=True)
    length = np.linalg.norm(x, axis=1, keepdims=True)
    # halfway between cube and ball inside, the ball itself at the surface
    round_ = np.where(length > 0, x / np.where(length > 0, length, 1) * shell, 0.0)
    points = shell * round_ + (1 - shell) * x
    vertices = points * np.array(semi_axes) + np.asarray(centre)
    return TetrahedralMesh(vertices, cube.tets)


@cache
def uneven_surface(subdivisions: int = 3, pose: int = 0) -> TriangleMesh:
    """Return a closed surface without a symmetry, far from the origin: unequal axes and
    triangles, and bumps on one side."""
    ball = uneven(sphere(1.0, subdivisions))
    x, y, z = ball.vertices.T
    height = 1.0 + 0.15 * np.sin(4.0 * x + y) * (1.0 + z)
    shape = height[:, None] * ball.vertices * [16.0, 24.0, 19.0]
    return transformed(TriangleMesh(shape, ball.faces), FAR[pose])


@cache
def uneven_body(cells: int = 4) -> TetrahedralMesh:
    """Return a body of linear elements without a symmetry, far from the origin: unequal
    axes and elements."""
    mesh = ellipsoid_mesh(cells, (16.0, 24.0, 19.0))
    x, y, z = mesh.vertices.T
    drawn = mesh.vertices * (1.0 + 0.01 * (x + 0.5 * y + 0.3 * z))[:, None]
    turned = drawn @ FAR[0][:3, :3].T + FAR[0][:3, 3]
    return TetrahedralMesh(turned, mesh.tets)


def smooth_field(points: np.ndarray, period_mm: float = 40.0) -> np.ndarray:
    """Return (n,) values between 0.5 and 2.5 that change along all three axes."""
    x, y, z = (points / period_mm).T
    return 1.5 + np.sin(x + 2.0 * y) * np.cos(3.0 * z - x)


def inner_edges_of_the_surface(mesh: TetrahedralMesh) -> set[tuple[int, int]]:
    """Return the edges of a linear mesh that join two vertices of its surface, but are
    on none of its faces."""
    faces = boundary_faces(mesh)[0].tolist()
    outer = {vertex for face in faces for vertex in face}
    on_surface = {frozenset((a, b)) for face in faces for a in face for b in face}
    found = set()
    for corners in mesh.tets.tolist():
        for a in corners:
            for b in corners:
                if a < b and {a, b} <= outer and {a, b} not in on_surface:
                    found.add((a, b))
    return found


def hemisphere(side: int) -> TriangleMesh:
    """Return an ellipsoid in place of a hemisphere, on the left (-1) or the right (1)
    of a gap of 3 mm at x = 0."""
    return ellipsoid(HALF_AXES, centre=(12.5 * side, 0.0, 0.0))


def save_labels(path, labels: np.ndarray, affine: np.ndarray) -> None:
    """Write labels as NIfTI in mm, as programs other than this one do."""
    image = nib.Nifti1Image(labels.astype(np.int16), affine)
    image.header.set_xyzt_units("mm")
    nib.save(image, path)


def save_gifti(path, mesh: TriangleMesh) -> None:
    """Write a GIFTI surface as it is, whatever is wrong with it, and name no space."""
    points = GiftiDataArray(
        mesh.vertices.astype(np.float32), intent="NIFTI_INTENT_POINTSET"
    )
    triangles = GiftiDataArray(
        mesh.faces.astype(np.int32), intent="NIFTI_INTENT_TRIANGLE"
    )
    nib.save(GiftiImage(darrays=[points, triangles]), path)
