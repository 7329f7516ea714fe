"""Quality of a mesh: radius ratio, dihedral angles and volumes of its elements, and how its surface was kept."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..geometry.crossings import crossing_faces
from ..geometry.jacobians import lower_bounds
from ..geometry.tetrahedra import TetrahedralMesh, boundary_faces, boundary_surface, radius_ratios, signed_volumes
from ..geometry.triangles import TriangleMesh, area, face_areas, mean_edge_length, signed_volume
from .fidelity import gap_kept, gap_summary, gap_walls, surface_distance

EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
OPPOSITE = ((2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1))


def jacobian_ratios(mesh: TetrahedralMesh) -> NDArray[np.float64]:
    """Returns for each of (m,) elements a lower bound of the determinant of its map, over the mean.

    It is 1 for straight sides with nodes on their middles, and positive only where the element folds over nowhere.
    """
    if mesh.order == 1:
        return np.ones(len(mesh.tets))
    return lower_bounds(mesh.vertices, mesh.tets) / (6 * signed_volumes(mesh))


def dihedral_angles(mesh: TetrahedralMesh) -> NDArray[np.float64]:
    """Returns the (m, 6) angles in degrees between the faces at each edge, as they are between the corners."""
    corner = mesh.vertices[mesh.corners]
    angles = np.empty((len(mesh.tets), 6))
    for i, ((a, b), (c, d)) in enumerate(zip(EDGES, OPPOSITE, strict=True)):
        edge = corner[:, b] - corner[:, a]
        first, second = (np.cross(edge, corner[:, k] - corner[:, a]) for k in (c, d))
        sine = np.linalg.norm(np.cross(first, second), axis=1)
        angles[:, i] = np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", first, second)))
    return angles


def element_quality(mesh: TetrahedralMesh) -> pd.DataFrame:
    """Returns per element radius_ratio, min_dihedral_deg, max_dihedral_deg, volume_mm3 and jacobian_ratio."""
    angles = dihedral_angles(mesh)
    return pd.DataFrame(
        {
            "radius_ratio": radius_ratios(mesh),
            "min_dihedral_deg": angles.min(axis=1),
            "max_dihedral_deg": angles.max(axis=1),
            "volume_mm3": signed_volumes(mesh),
            "jacobian_ratio": jacobian_ratios(mesh),
        }
    )


def elements_through(mesh: TetrahedralMesh, thickness_mm: float) -> float:
    """Returns the elements through a layer below the surface: its thickness over the mean edge length in it.

    Those elements count whose centroid lies within `thickness_mm` of a vertex of the surface.
    """
    outer = np.unique(boundary_faces(mesh)[0])
    depth = cKDTree(mesh.vertices[outer]).query(mesh.vertices[mesh.corners].mean(axis=1))[0]
    corner = mesh.vertices[mesh.corners[depth <= thickness_mm]]
    lengths = [np.linalg.norm(corner[:, b] - corner[:, a], axis=1) for a, b in EDGES]
    return float(thickness_mm / np.mean(lengths))


def quality_summary(mesh: TetrahedralMesh, surface: TriangleMesh) -> dict[str, Any]:
    """Returns counts, extreme and mean qualities, edge lengths and areas of a mesh, ready for JSON.

    `surface` is the one that was filled: `surface_distance_mm` is that of the mesh's surface from it, `volume_change`
    that of the volume, relative to the one inside it. Of quadratic elements all of them are taken on the triangles
    between nodes. `gap_mm` holds the gaps of both, and `gap_kept` the share of the
    given one's gaps that the mesh leaves open, None where it has none (see `fidelity`). `histogram` holds for radius
    ratio, dihedral angles and volume the edges of the classes and the number of elements in each.
    """
    quality = element_quality(mesh)
    own, _ = boundary_surface(mesh)
    volume = quality["volume_mm3"]
    walls = gap_walls(surface)
    classes = {
        "radius_ratio": np.linspace(0, 1, 41),
        "min_dihedral_deg": np.linspace(0, 90, 46),
        "max_dihedral_deg": np.linspace(60, 180, 61),
        "volume_mm3": 10.0 ** (np.arange(*_tenths_of_decades(volume)) / 10),
    }
    return {
        "order": mesh.order,
        "tets": len(mesh.tets),
        "vertices": len(mesh.vertices),
        "pial_faces": len(own.faces),
        "pial_edge_mm": mean_edge_length(own),
        "pial_area_mm2": area(own),
        "smallest_pial_face_mm2": float(face_areas(own).min()),
        "crossing_faces": crossing_faces(own),
        "surface_distance_mm": surface_distance(own, surface),
        "gap_mm": {"input": gap_summary(walls), "mesh": gap_summary(gap_walls(own))},
        "gap_kept": gap_kept(walls, own),
        "volume_mm3": float(volume.sum()),
        "volume_change": float(volume.sum() / signed_volume(surface) - 1),
        "min_radius_ratio": float(quality["radius_ratio"].min()),
        "mean_radius_ratio": float(quality["radius_ratio"].mean()),
        "median_radius_ratio": float(quality["radius_ratio"].median()),
        "min_dihedral_deg": float(quality["min_dihedral_deg"].min()),
        "max_dihedral_deg": float(quality["max_dihedral_deg"].max()),
        "min_volume_mm3": float(volume.min()),
        "min_jacobian_ratio": float(quality["jacobian_ratio"].min()),
        "histogram": {
            name: {"edges": edges.tolist(), "counts": np.histogram(quality[name], edges)[0].tolist()}
            for name, edges in classes.items()
        },
    }


def _tenths_of_decades(values: pd.Series) -> tuple[int, int]:
    """Returns the range of n for which 10^(n/10) are the edges of classes that hold all of some positive values."""
    logarithms = 10 * np.log10(values)
    return int(np.floor(logarithms.min())) - 1, int(np.ceil(logarithms.max())) + 2
