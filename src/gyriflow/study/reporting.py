"""What the report and the tables of quality say of a study's brains, besides its figures."""

from collections.abc import Mapping
from typing import Any

from ..config.brains import Brain as GivenBrain
from .paths import PIAL_RULES, THICKNESS
from .records import Brain
from .study import Study


def used_settings(study: Study) -> dict[str, Any]:
    """Return the configuration; the brains of the atlas are among the brains by now."""
    return study.config.model_dump(mode="json", exclude_defaults=True, exclude={"atlas", "participants"})


def described_brains(study: Study) -> list[dict[str, Any]]:
    """Return what the configuration says of each brain, refused ones too, with its licence where it is of an atlas."""
    licences = {
        used.atlas.brain_id(file.series, file.week): used.atlas.licence.name
        for used in study.config.atlases
        for file in used.files
    }
    keys = ("id", "week", "population", "source", "synthetic")
    return [
        {**{key: getattr(brain, key) for key in keys}, "licence": licences.get(brain.id)}
        for brain in study.config.brains
    ]


def input_files(study: Study) -> list[tuple[str, str, str]]:
    """Return brain, what it is and path of all files that brains are made from."""
    return [
        (brain.id, what, path)
        for brain in study.brains.values()
        for what, paths in (
            (brain.given.source, brain.given.files),
            ("image", [brain.given.image] if brain.given.image else []),
            ("white", list(brain.given.white_files.values())),
        )
        for path in paths
    ]


def method(study: Study) -> dict[str, Any]:
    """Return what the text of the methods says of the configuration: its brains, and settings by section."""
    named = {"surface": {"edge_length_mm"}, "mesh": {"mesher", "order"}, "metrics": {"curvature_radius_mm"}}
    brains = [brain for brain in described_brains(study) if brain["id"] in study.brains]
    return {"brains": brains, **study.config.model_dump(mode="json", include=named)}


def quality_labels(brain: GivenBrain) -> dict[str, Any]:
    """Return what the table of quality says of a brain before it is looked at."""
    return {
        "subject": brain.id,
        **{key: getattr(brain, key) for key in ("week", "population", "source")},
        "sides": " ".join(brain.sides),
        "page": f"results/brains/{brain.id}/figures/quality.png",
    }


def refused_rows(study: Study, causes: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return the rows of that table for brains that were refused, or left out of the list of participants."""
    rows = [quality_labels(study.config.brain(brain)) | {"cause": why, "page": None} for brain, why in causes.items()]
    return rows + [{"subject": row, **values} for row, values in study.config.left_out.items()]


def quality_files(brain: Brain) -> dict[str, Any]:
    """Return the files that the page of a brain's quality shows."""
    return {
        "surface": brain.pial,
        "report": brain.report,
        "labels": brain.given.label_volume or [],
        "image": brain.given.image or [],
        "white": list(brain.given.white_files.values()),
        "thickness": brain.measured.thickness,
        "measured": THICKNESS["report"].format(brain=brain.id) if brain.thickness_from else [],
    }


def surface_logs(brain: Brain) -> list[str]:
    """Return the logs of the steps that have made a brain's surface and thickness."""
    made_by = [rule for rule, made in PIAL_RULES.items() if made == (brain.given.source, brain.sides)]
    return [f"results/brains/{brain.id}/logs/{rule}.log" for rule in (*made_by, "cortical_thickness")]
