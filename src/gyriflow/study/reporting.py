"""What the report and the tables of quality say of a configuration, besides its figures."""

from dataclasses import dataclass
from typing import Any

from ..config.root import Config
from .brains import Brains
from .paths import BRAIN, PIAL, THICKNESS

# the step that makes the surface, by the source of a brain, as its log is called
_PIAL_STEPS = {
    "labels": "pial_from_labels",
    "hemispheres": "pial_from_hemispheres",
    "hemisphere": "pial_from_{side}_hemisphere",
    "pial": "pial_from_surface",
    "shape": "pial_from_shape",
}


@dataclass(frozen=True)
class Reporting:
    """The words on brains, files and settings of a configuration; `whole` has its refused brains, too."""

    config: Config
    brains: Brains
    whole: Config

    @property
    def used(self) -> dict[str, Any]:
        """The configuration; the brains of the atlas are among the brains by now."""
        return self.whole.model_dump(mode="json", exclude_defaults=True, exclude={"atlas", "participants"})

    @property
    def described(self) -> list[dict[str, Any]]:
        """What the configuration says of each brain, with its licence where it is of an atlas."""
        licences = {
            used.atlas.brain_id(file.series, file.week): used.atlas.licence.name
            for used in self.config.atlases
            for file in used.files
        }
        keys = ("id", "week", "population", "source", "synthetic")
        return [
            {**{key: getattr(brain, key) for key in keys}, "licence": licences.get(brain.id)}
            for brain in self.whole.brains
        ]

    @property
    def files(self) -> list[tuple[str, str, str]]:
        """Brain, what it is and path of all files that brains are made from."""
        return [
            (brain.id, what, path)
            for brain in self.config.brains
            for what, paths in (
                (brain.source, brain.files),
                ("image", [brain.image] if brain.image else []),
                ("white", list(brain.white_files.values())),
            )
            for path in paths
        ]

    @property
    def method(self) -> dict[str, Any]:
        """What the text of the methods says of the configuration: its brains, and settings by section."""
        named = {
            **{"surface": {"edge_length_mm"}, "mesh": {"mesher", "order"}},
            "metrics": {"curvature_radius_mm", "spangy_proxy"},
        }
        used = self.config.model_dump(mode="json", include=named)
        return {"brains": [brain for brain in self.described if brain["id"] in self.brains.ids], **used}

    def labels(self, brain: str) -> dict[str, Any]:
        """Returns what the table of quality says of a brain before it is looked at."""
        settings = self.whole.brain(brain)
        return {
            "subject": brain,
            **{key: getattr(settings, key) for key in ("week", "population", "source")},
            "sides": " ".join(settings.sides),
            "page": f"{BRAIN}/figures/quality.png".format(brain=brain),
        }

    def refused(self, causes: dict[str, str]) -> list[dict[str, Any]]:
        """Returns the rows of that table for brains that were refused, or left out of the list of participants."""
        rows = [self.labels(brain) | {"cause": cause, "page": None} for brain, cause in causes.items()]
        return rows + [{"subject": row, **said} for row, said in self.whole.left_out.items()]

    def looked_at(self, brain: str) -> dict[str, Any]:
        """Returns the files that the page of a brain's quality shows."""
        settings = self.config.brain(brain)
        known = brain in self.brains.with_thickness
        return {
            "surface": PIAL["whole"].format(brain=brain),
            "report": PIAL["report"].format(brain=brain),
            "labels": self.brains.label_volume(brain) if settings.has_labels else [],
            "image": settings.image or [],
            "white": list(settings.white_files.values()),
            "thickness": THICKNESS["measured"].format(brain=brain) if known else [],
            "measured": THICKNESS["report"].format(brain=brain) if known else [],
        }

    def logs(self, brain: str) -> list[str]:
        """Returns the logs of the steps that have made a brain's surface and thickness."""
        settings = self.config.brain(brain)
        surface = _PIAL_STEPS[settings.source].format(side=settings.sides[0])
        return [
            f"results/brains/{brain}/logs/{name}.log"
            for name in (surface, "cortical_thickness", "thickness_from_white")
        ]
