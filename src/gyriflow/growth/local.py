"""Local growth at every vertex, from a mesh that was carried over weeks."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..geometry.alignment import rigid_fit
from ..geometry.diffusion import cell_sizes, diffuse, vertex_sizes
from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, linear_pieces
from ..geometry.triangles import Floats


def growth_over_weeks(
    mesh: TetrahedralMesh, positions: Floats, weeks: Sequence[float], sigma_mm: float, own: int, with_strain: bool
) -> dict[str, Floats]:
    """Returns `local_growth` of a mesh's volume and of its boundary's area, and `local_strain` on demand, by kind."""
    cells = {"volume": linear_pieces(mesh), "area": boundary_faces(mesh)[0]}
    growth = {kind: local_growth(positions, found, weeks, sigma_mm, own=own) for kind, found in cells.items()}
    if with_strain:
        growth["strain"] = local_strain(positions, cells["volume"], weeks, sigma_mm, own=own)
    return growth


def local_growth(
    positions: Floats, cells: NDArray[np.integer], weeks: Sequence[float], sigma_mm: float, *, own: int = 0
) -> Floats:
    """Returns the (w − 1, n) local log growth per week: of area for triangles, of volume for tetrahedra.

    The size that belongs to a vertex, as a multiple of that in the mesh's own week, is smoothed in both weeks by
    diffusion along the mesh, and the logarithm of the ratio divided by the time between. Smoothed so, the whole grows
    as measured whatever the length, and single inverted elements do no harm. A growth of volume is that of the map's
    gradient, ln det ∇; one of the pial triangles is tangential.

    Parameters
    ----------
    positions
        (w, n, 3) positions in mm of the same vertices in all weeks: vertex-matched surfaces, or a mesh carried along.
    cells
        (m, 3) triangles or (m, 4) tetrahedra, sound in their own week.
    weeks
        Gestational weeks, ascending.
    sigma_mm
        Standard deviation of the Gaussian in mm of each interval's first week (2.355 times less than its full width at
        half maximum): lengths of the mesh's own week are scaled with the whole to that week's.
    own
        Index of the week that the mesh was made in; the others it was carried to.

    InputError where weeks do not ascend, or a vertex's share vanishes or is inverted after smoothing.
    """
    _require_ascending(positions, weeks)
    start = vertex_sizes(positions[own], cells)
    used = start > 0
    dimension = cells.shape[1] - 1
    sizes = np.stack([vertex_sizes(position, cells) for position in positions])
    relative = np.where(used, sizes, 1.0) / np.where(used, start, 1.0)
    rates = []
    for number, duration in enumerate(np.diff(weeks)):
        scale = (sizes[number].sum() / sizes[own].sum()) ** (1 / dimension)
        smooth = diffuse(positions[own], cells, relative[number : number + 2].T, sigma_mm / scale)
        bad = np.asarray(smooth.min(axis=1) <= 0)
        if bad.any():
            raise InputError(
                f"local growth from week {weeks[number]:g} to {weeks[number + 1]:g} has no logarithm",
                found=f"{np.count_nonzero(bad)} of {len(bad)} vertices in inverted or vanished cells",
                expected="none",
                remedy=f"Smooth growth by more than {sigma_mm:g} mm, or look at the registration of these weeks.",
            )
        rates.append(np.log(smooth[:, 1] / smooth[:, 0]) / duration)
    return np.stack(rates)


def local_strain(
    positions: Floats, cells: NDArray[np.integer], weeks: Sequence[float], sigma_mm: float, *, own: int = 0
) -> Floats:
    """Returns the (w − 1, n, 6) local strain per week without its change of volume: xx, yy, zz, xy, xz, yz.

    It is the deviator of ln U, with U² = Fᵀ·F and F the gradient of the map between successive weeks: how much faster
    growth is in some directions. It refers to the shape of each interval's first week, turned as a whole to lie as in
    the mesh's own week. Elements that are inverted in one of the weeks do not count. Smoothed as in `local_growth`.

    Parameters
    ----------
    positions, cells, weeks, sigma_mm, own
        As for `local_growth`, tetrahedra.
    """
    _require_ascending(positions, weeks)
    mass = vertex_sizes(positions[own], cells)
    volumes = cell_sizes(positions[own], cells)
    # edges from the first corner, as the columns of a matrix
    edges = np.swapaxes(positions[:, cells[:, 1:]] - positions[:, cells[:, :1]], 2, 3)
    rates = []
    for number, duration in enumerate(np.diff(weeks)):
        turn = rigid_fit(positions[number], positions[own], mass)[:3, :3]
        first, second = edges[number], edges[number + 1]
        sound = (np.linalg.det(first) > 0) & (np.linalg.det(second) > 0)
        F = np.tile(np.eye(3), (len(cells), 1, 1))
        F[sound] = second[sound] @ np.linalg.inv(turn @ first[sound])
        squares, axes = np.linalg.eigh(np.swapaxes(F, 1, 2) @ F)
        logs = np.clip(0.5 * np.log(squares), -1.0, 1.0)
        logs -= logs.mean(axis=1, keepdims=True)
        strain = (axes * logs[:, None, :]) @ np.swapaxes(axes, 1, 2)
        parts = strain[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] * (volumes / cells.shape[1])[:, None]
        sums = np.stack([np.bincount(cells.ravel(), np.repeat(part, 4), len(mass)) for part in parts.T], axis=1)
        scale = (cell_sizes(positions[number], cells).sum() / volumes.sum()) ** (1 / 3)
        at_vertices = sums / np.where(mass > 0, mass, 1.0)[:, None]
        rates.append(diffuse(positions[own], cells, at_vertices, sigma_mm / scale) / duration)
    return np.stack(rates)


def _require_ascending(positions: Floats, weeks: Sequence[float]) -> None:
    if len(positions) != len(weeks) or len(weeks) < 2 or not (np.diff(weeks) > 0).all():
        raise InputError(
            "growth is between successive weeks",
            found=f"weeks {list(weeks)} for {len(positions)} meshes",
            expected="two or more, ascending, one for each mesh",
        )
