"""The section that names a table of participants."""

from typing import Any

from pydantic import ConfigDict, Field, model_validator

from .base import Settings


class ParticipantsSettings(Settings):
    """A table with a brain in each row. `participants: FILE` is short for a section.

    Columns are `participant_id` (or `id`); the gestational age, `gestational_age` or `week`, as `24.3`, `24+2` or
    `24w2d` (or `age_weeks`, `age_days`, or `age` with its unit in the sidecar); and keys of brains, inner ones with a
    dot (`hemispheres.left`), two `white` surfaces with a semicolon between. Instead of keys, `files` may name labels, a
    pial surface, or left and right surfaces with a semicolon between; with `side`, one hemisphere. `n/a` is an empty
    value. Other columns are covariates. Each participant is a subject. One with a `sub-01/sub-01_sessions.tsv` next to
    the table has a brain for each session, with its age.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string"]})

    file: str
    """Tab-separated file; paths in it are relative to it."""
    columns: dict[str, str] = Field({})
    """Columns to add to the table, with one value for all rows. In it `{subject}`, `{session}` and `{id}`,
    such as `sub-01_ses-1`, are the row's: `{labels: '{subject}/{session}/anat/{id}_dseg.nii.gz', scheme:
    feta-7}`."""

    @model_validator(mode="before")
    @classmethod
    def _file_alone(cls, value: Any) -> Any:
        return {"file": value} if isinstance(value, str) else value
