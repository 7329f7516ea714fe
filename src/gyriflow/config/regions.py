"""Regions of the cortex that users or atlases give on brains of a study."""

from collections.abc import Iterator, Mapping
from typing import Annotated

from pydantic import Field

from ..parameters.files import InputFile
from ..parameters.settings import Problem, Settings, check, setting

Label = Annotated[int, Field(ge=1, le=2**31 - 1)]


class SurfaceRegions(Settings):
    """Regions at the vertices of a hemisphere's surface."""

    labels: InputFile = setting(..., "", "GIFTI label file (.label.gii), a label per vertex of `surface`.")
    surface: InputFile = setting(
        ..., "", "Surface of the hemisphere that the labels belong to, in the coordinates of the brain's own files."
    )


class GivenRegions(Settings):
    """Regions of a brain, from a label volume or from labels of both hemispheres' surfaces.

    Left and right regions of one name are compared with each other. Other brains and simulations get the regions of the
    brain of the nearest week.
    """

    volume: InputFile | None = setting(
        None, "", "Label volume (NIfTI) in the space of the brain's `labels`, with regions along the cortex."
    )
    left: SurfaceRegions | None = setting(None, "", "Instead of a volume, labels of the left hemisphere.")
    right: SurfaceRegions | None = setting(None, "", "Labels of the right hemisphere.")
    names: dict[Label, str] = setting(
        {}, "",
        "Name of each label, such as `{1: frontal, 2: frontal, 3: parietal}`; labels of one name, as of left and "
        "right, are one region, and others are none. Needed with a volume; without, those in the label files.",
    )  # fmt: skip

    @check
    def _one_source(self) -> Iterator[Problem]:
        sides = [side for side in ("left", "right") if self.gives(side)]
        if self.gives("volume") == bool(sides):
            found = "both" if sides else "neither"
            yield Problem(f"found {found}; expected volume, or left and right")
        elif len(sides) == 1:
            missing = "right" if sides == ["left"] else "left"
            yield Problem("is missing; both hemispheres need labels", (missing,))

    @check
    def _names_for_a_volume(self) -> Iterator[Problem]:
        if self.gives("volume") and self.has("names") and not self.names:
            yield Problem("is missing; it names the regions of the volume", ("names",))

    @property
    def files(self) -> dict[str, str]:
        """The files by what they are."""
        if self.volume is not None:
            return {"volume": self.volume}
        pairs = {"left": self.left, "right": self.right}
        return {
            f"{side}_{kind}": getattr(pair, kind)
            for side, pair in pairs.items()
            if pair is not None
            for kind in ("labels", "surface")
        }


def nearest_given(brain: str, given: Mapping[str, GivenRegions], weeks: Mapping[str, float]) -> str | None:
    """Returns the brain whose regions a brain gets: itself, else that of the nearest week; None without any."""
    if brain in given or not given:
        return brain if brain in given else None
    return min(given, key=lambda other: abs(weeks[other] - weeks[brain]))
