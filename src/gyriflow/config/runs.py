"""The runs of a study: their settings, and the brains that each of them folds."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Discriminator, Tag

from ..parameters.folding import FoldingSettings
from ..parameters.settings import setting

ALL = "all"
"""The word for all brains in `start`."""
FIRST = "first"
"""The word for the first brain of `brains` in `start`: of an atlas its earliest, if no other stands before it."""

Start = Annotated[
    Annotated[str, Tag("(id)")] | Annotated[tuple[str, ...], Tag("(list)")],
    Discriminator(lambda value: "(list)" if isinstance(value, list | tuple) else "(id)"),
]
"""The id of a brain, a list of ids, `first` or `all`."""


class Run(FoldingSettings):
    """The complete settings of a run: those of `folding` with the run's own on top."""

    start: Start | None = setting(
        None, "", "Id of the brain that is folded, a list of ids, `first` or `all`; `null`: the study's `start`."
    )


def start_ids(start: Start | None, brains: Sequence[str]) -> list[str]:
    """Returns the ids of the brains that `start` names, in the order of `brains`; unknown ones are left out."""
    if start == FIRST:
        return list(brains[:1])
    named = brains if start == ALL else [start] if isinstance(start, str) else start or ()
    return [brain for brain in brains if brain in named]
