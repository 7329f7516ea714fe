"""The section that names a table of participants."""

from typing import Any

from pydantic import ConfigDict, Field, model_validator

from .base import Settings
from .weeks import WeekNotation


class ParticipantsSettings(Settings):
    """A table with a brain in each row. `participants: FILE` is short for a section.

    Columns are `participant_id` (or `id`); `session_id` (or `session`, `visit`) where a subject has several scans; the
    age of the scan, `scan_age`, `pma`, `gestational_age` or `week`, as `24.3`, `24+2` or `24w2d` (in days with
    `age_days`; `age` has its unit in the sidecar); and keys of brains, inner ones with a dot (`hemispheres.left`), two
    `white` surfaces with a semicolon between. Instead of keys, `files` may name labels, a pial surface, or left and
    right surfaces with a semicolon between; with `side`, one hemisphere. `n/a` is an empty value. Other columns are
    covariates. Each participant is a subject. One with a `sub-01/sub-01_sessions.tsv` next to the table has a brain
    for each session, with its age.
    """

    model_config = ConfigDict(json_schema_extra={"type": ["object", "string"]})

    file: str
    """File with tabs, semicolons or commas between columns; paths in it are relative to it."""
    ages: WeekNotation | None = None
    """Whether 24.3 is a `decimal` or 24 weeks and 3 `days`; needed if all decimals of a table could be days."""
    columns: dict[str, str] = Field({})
    """Columns to add to the table, with one value for all rows. In it `{subject}`, `{session}` and `{id}`,
    such as `sub-01_ses-1`, are the row's: `{labels: '{subject}/{session}/anat/{id}_dseg.nii.gz', scheme:
    feta-7}`."""

    @model_validator(mode="before")
    @classmethod
    def _file_alone(cls, value: Any) -> Any:
        return {"file": value} if isinstance(value, str) else value
