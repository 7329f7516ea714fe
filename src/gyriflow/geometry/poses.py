"""Pose of a brain: rigid motions from the coordinates of its files to its posed
surface, and their evidence."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import InputError
from .triangles import Floats, TriangleMesh, transformed

LPS_TO_RAS: Floats = np.diag([-1.0, -1.0, 1.0, 1.0])
"""Also the motion from RAS to LPS: it is its own inverse."""
CONVENTIONS: dict[str, Floats] = {
    "ras": np.eye(4),
    "lps": LPS_TO_RAS,
}
"""Axes of files, as motions (4, 4) to RAS+."""


@dataclass(frozen=True, eq=False)
class Pose:
    """Rigid motions (4, 4) in mm that pose a brain, and their evidence.

    `world` leads from the world of the brain's volumes, RAS+, to its surface;
    correspondences refer to these worlds. `files` lead from the coordinates of its
    surface files: "left" and "right" for hemispheres, and "whole". `by` is the origin
    of the pose: "file", "shape", "configuration", "default", or parts of the labels.
    `together` is False if the hemispheres were posed separately. `evidence` has angles,
    residuals and distances, in plain values for JSON.
    """

    world: Floats = field(default_factory=lambda: np.eye(4))
    files: Mapping[str, Floats] = field(default_factory=dict)
    by: str = "file"
    together: bool = True
    evidence: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    @property
    def inverse(self) -> Floats:
        """The (4, 4) motion from the surface to the world of the brain's volumes."""
        return np.asarray(np.linalg.inv(self.world))

    def of_file(self, side: str = "whole") -> Floats:
        """Return the (4, 4) motion from the coordinates of a surface file to the
        surface."""
        return self.files.get(
            side,
            self.files.get("whole", self.world),
        )

    def of_volume(self, path: str) -> Floats:
        """Return the (4, 4) motion from the brain's volumes to its surface; InputError
        if the sides have two."""
        if self.together:
            return self.world
        raise InputError(
            "a volume cannot belong to a brain whose hemispheres were posed separately",
            path=path,
            remedy=(
                "Give the values per vertex (GIFTI), on surfaces of the brain, or"
                " hemispheres posed as one brain."
            ),
        )

    def then(self, matrix: Floats) -> "Pose":
        """Return the pose with a (4, 4) motion after it."""
        files = {name: matrix @ pose for name, pose in self.files.items()}
        return replace(self, world=matrix @ self.world, files=files)

    def plain(self) -> dict[str, Any]:
        """Return the pose in plain values for JSON."""
        return {
            "by": self.by,
            "together": self.together,
            "world": self.world.tolist(),
            "files": {name: pose.tolist() for name, pose in self.files.items()},
            "evidence": dict(self.evidence),
            "warnings": list(self.warnings),
        }


def pose_from(plain: Mapping[str, Any]) -> Pose:
    """Return the pose from its plain values (see `Pose.plain`)."""
    return Pose(
        np.array(plain["world"]),
        {name: np.array(pose) for name, pose in plain["files"].items()},
        plain["by"],
        plain["together"],
        plain["evidence"],
        tuple(plain["warnings"]),
    )


def turned(
    rotation: Floats,
    by: str,
    coordinates: str = "ras",
    *warnings: str,
) -> Pose:
    """Return the pose of a file that a (3, 3) rotation brings to RAS+; the brain's
    volumes are in RAS+ already."""
    # takes half a second to import, which reading surfaces need not wait for
    from .alignment import motion

    whole = motion(rotation)
    world = whole @ CONVENTIONS[coordinates]
    return Pose(world, {"whole": whole}, by, warnings=warnings)


def posed_whites(
    pose: Pose, whites: Mapping[str, TriangleMesh]
) -> dict[str, TriangleMesh]:
    """Return the white surfaces by side, in the pose of the pial surfaces."""
    return {
        side: transformed(mesh, pose.of_file(side)) for side, mesh in whites.items()
    }
