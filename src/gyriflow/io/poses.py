"""The pose of a brain, from the report of its surface or from the file of its hemispheres' poses."""

from ..geometry.poses import Pose, pose_from
from .files import AnyPath, read_json


def read_pose(path: AnyPath) -> Pose:
    """Returns the pose in a `surface.json` or `pose.json`; InputError, for its reason, where it is a refusal."""
    found = read_json(path)
    return pose_from(found.get("pose", found))
