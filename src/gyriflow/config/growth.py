"""Settings of the growth rates, and the series of brains that they are estimated from."""

from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import Discriminator, Tag

from ..parameters.settings import Settings, setting

Names = tuple[str, ...]
Series = Annotated[
    Annotated[Names, Tag("(list)")] | Annotated[dict[str, Names], Tag("(table)")],
    Discriminator(lambda value: "(table)" if isinstance(value, dict) else "(list)"),
]


class GrowthSettings(Settings):
    """Which brains the growth rates are estimated from."""

    brains: Series | None = setting(
        None, "",
        "Ids of the brains whose areas and volumes count, of two weeks or more; or such lists by the name of a series, "
        "as `{surface: [...], volume: [...]}`. `null`: all brains. Without names, brains from surfaces and brains from "
        "label volumes are two series, `surface` and `volume`, where both have two weeks or more. Brains of several "
        "populations are never one series: without names each population is one, and goes by its own name.",
    )  # fmt: skip
    estimated_from: str | None = setting(
        None, "", "Series that `estimated` rates of the folding are taken from; `null`: the start brain's."
    )


def growth_series(
    kinds: Mapping[str, str],
    weeks: Mapping[str, float],
    given: Sequence[str] | Mapping[str, Sequence[str]] | None,
    populations: Mapping[str, str | None] | None = None,
) -> dict[str, list[str]]:
    """Returns the ids of the brains of each series of growth rates, those of fewer than two weeks left out.

    Parameters
    ----------
    kinds
        Kind of data of each brain by id: "surface" or "volume".
    weeks
        Gestational week of each.
    given
        The setting `brains`; its ids have to be known.
    populations
        Population of each brain, where known; no series without a name of its own has brains of two.
    """
    if isinstance(given, Mapping):
        series = {name: [brain for brain in kinds if brain in ids] for name, ids in given.items()}
    else:
        chosen = [brain for brain in kinds if given is None or brain in given]
        of = {brain: (populations or {}).get(brain) for brain in chosen}
        several = len(set(of.values())) > 1
        series = {}
        for population in dict.fromkeys(of.values()):
            ids = [brain for brain in chosen if of[brain] == population]
            by_kind = _series_by_kind({brain: kinds[brain] for brain in ids}, weeks)
            for kind, brains in by_kind.items():
                parts = [population or "", kind if len(by_kind) > 1 or not population else ""]
                series[", ".join(part for part in parts if part) if several else kind] = brains
    return {name: ids for name, ids in series.items() if _ages(ids, weeks) > 1}


def _series_by_kind(kinds: Mapping[str, str], weeks: Mapping[str, float]) -> dict[str, list[str]]:
    """Returns brains by the kind of their data; all together where one kind has no two ages."""
    by_kind = {kind: [brain for brain in kinds if kinds[brain] == kind] for kind in ("surface", "volume")}
    known = {kind: ids for kind, ids in by_kind.items() if ids}
    several = len(known) > 1 and all(_ages(ids, weeks) > 1 for ids in known.values())
    # brains of which one kind has no two ages can only be compared across kinds
    return known if several or len(known) == 1 else {"all": list(kinds)}


def estimated_from(series: Mapping[str, Sequence[str]], given: str | None, start: str) -> str | None:
    """Returns the name of the series that `estimated` rates are taken from, None where that is not said.

    It is the one that is given, else the only one, else the one with the start brain.
    """
    if given is not None:
        return given if given in series else None
    return next((name for name, ids in series.items() if len(series) == 1 or start in ids), None)


def _ages(ids: Sequence[str], weeks: Mapping[str, float]) -> int:
    return len({weeks[brain] for brain in ids})
