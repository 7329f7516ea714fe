"""White surfaces (the inner border of the cortex) from labels or files, even and split like pial surfaces."""

from collections.abc import Mapping

import numpy as np

from ..geometry.poses import Pose
from ..geometry.triangles import TriangleMesh
from ..settings.schemes import LabelScheme
from ..settings.terms import Side
from .extraction import Floats, smooth_mask
from .fissure import cut_sides, nearer_left
from .labels import Labels, read_cerebrum
from .repair import make_sound, sound_pieces, surface_of_mask
from .thickness import posed_whites


def white_from_labels(
    labels: Labels,
    affine: Floats,
    scheme: LabelScheme,
    pial: Mapping[Side, TriangleMesh],
    pose: Pose,
    *,
    edge_length_mm: float = 1.0,
) -> dict[Side, TriangleMesh]:
    """Return by side the surface around the tissue within the cortex of an (i, j, k) label volume.

    It is made like the pial surface in `pial.from_labels`, in the same pose. Where the cerebrum has no cortex, as on
    the medial wall, both surfaces coincide. MeshError if it keeps self-intersections.
    """
    cerebrum = read_cerebrum(labels, pose.world @ affine, scheme)
    core = cerebrum.mask & ~np.isin(cerebrum.tissue, scheme.cortex)
    volume = float(core.sum() * abs(np.linalg.det(cerebrum.affine[:3, :3])))
    field, smallest = smooth_mask(core), cerebrum.smallest_part
    even = surface_of_mask(field, cerebrum.affine, volume, edge_length_mm, smallest=smallest)
    return _sides(even.mesh, pial)


def white_from_surfaces(
    whites: Mapping[str, TriangleMesh],
    pial: Mapping[Side, TriangleMesh],
    pose: Pose,
    *,
    max_hole_mm: float = 3.0,
    edge_length_mm: float = 1.0,
) -> dict[Side, TriangleMesh]:
    """Pose and remesh white surfaces of "left" and "right" or of the "whole"; return them by side.

    MeshError if one cannot be made a closed surface without handles and self-intersections.
    """
    even = {
        name: make_sound(sound_pieces(mesh, max_hole_mm).mesh, edge_length_mm).mesh
        for name, mesh in posed_whites(pose, whites).items()
    }
    return _sides(even["whole"], pial) if "whole" in even else {side: even[side] for side in pial}


def _sides(mesh: TriangleMesh, pial: Mapping[Side, TriangleMesh]) -> dict[Side, TriangleMesh]:
    if len(pial) == 1:
        return dict.fromkeys(pial, mesh)
    left, right = cut_sides(mesh, nearer_left(mesh, pial["left"], pial["right"]))
    return {"left": left, "right": right}
