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
        "Ids of the brains whose areas and volumes are used, of two weeks or more; or several such lists by name of a "
        "series, such as `{surface: [...], volume: [...]}`. `null`: all brains. Without names, brains from surfaces "
        "and brains from label volumes form two series, `surface` and `volume`, if each has two weeks or more. "
        "Different populations are never mixed: without names each population forms a series of that name.",
    )  # fmt: skip
    estimated_from: str | None = setting(
        None, "", "Series that gives the `estimated` rates of the folding; `null`: that of the start brain."
    )
    matched_surfaces: bool = setting(
        True, "",
        "Whether a series of surfaces with the same vertices and triangles in all weeks tells where each vertex goes: "
        "local growth then comes from these vertices, without registration. `false`: they are not the same places.",
    )  # fmt: skip


def growth_series(
    kinds: Mapping[str, str],
    weeks: Mapping[str, float],
    given: Sequence[str] | Mapping[str, Sequence[str]] | None,
    populations: Mapping[str, str | None] | None = None,
) -> dict[str, list[str]]:
    """Returns the ids of the brains of each series of growth rates, without series of fewer than two weeks.

    Parameters
    ----------
    kinds
        Kind of data of each brain by id: "surface" or "volume"; of a hemisphere that is alone with its side in front,
        such as "left surface". These never share a series with brains of two hemispheres or of the other one.
    weeks
        Gestational week of each.
    given
        The setting `brains`; all its ids must be known.
    populations
        Population of each brain, if known. Only a named series may mix populations.
    """
    if isinstance(given, Mapping):
        series = {name: [brain for brain in kinds if brain in ids] for name, ids in given.items()}
    else:
        chosen = [brain for brain in kinds if given is None or brain in given]
        of = {brain: ((populations or {}).get(brain), *_side_and_kind(kinds[brain])) for brain in chosen}
        groups = dict.fromkeys((population, side) for population, side, _ in of.values())
        several = len(groups) > 1
        series = {}
        for population, side in groups:
            ids = [brain for brain in chosen if of[brain][:2] == (population, side)]
            by_kind = _series_by_kind({brain: of[brain][2] for brain in ids}, weeks)
            for kind, brains in by_kind.items():
                parts = [population or "", side, kind if len(by_kind) > 1 or not population else ""]
                series[", ".join(part for part in parts if part) if several else kind] = brains
    return {name: ids for name, ids in series.items() if _ages(ids, weeks) > 1}


def _side_and_kind(kind: str) -> tuple[str, str]:
    """Returns "left hemisphere", "right hemisphere" or "" where there are both, and "surface" or "volume"."""
    *side, kind = kind.split()
    return " ".join([*side, "hemisphere"]) if side else "", kind


def _series_by_kind(kinds: Mapping[str, str], weeks: Mapping[str, float]) -> dict[str, list[str]]:
    """Returns brains by kind of data, or all together if one kind has fewer than two ages."""
    by_kind = {kind: [brain for brain in kinds if kinds[brain] == kind] for kind in ("surface", "volume")}
    known = {kind: ids for kind, ids in by_kind.items() if ids}
    several = len(known) > 1 and all(_ages(ids, weeks) > 1 for ids in known.values())
    # a kind with a single age can only be compared across kinds
    return known if several or len(known) == 1 else {"all": list(kinds)}


def estimated_from(series: Mapping[str, Sequence[str]], given: str | None, start: str) -> str | None:
    """Returns the name of the series that gives the `estimated` rates; None if it is not determined.

    It is the given one, or the only one, or the one with the start brain.
    """
    if given is not None:
        return given if given in series else None
    return next((name for name, ids in series.items() if len(series) == 1 or start in ids), None)


def _ages(ids: Sequence[str], weeks: Mapping[str, float]) -> int:
    return len({weeks[brain] for brain in ids})
