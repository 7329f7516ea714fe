"""What the report says first: what was done, the brains, and a row for each run with its verdict and scores."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from .resolution import resolution_verdict
from .style import run_names, week_label

DEEP_MM = 0.5
"""Walls of the fissure that begin so far beyond their planes are told of."""


def brains_table(
    brains: Sequence[Mapping[str, Any]],
    surfaces: Mapping[str, Mapping[str, Any]],
    quality: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """Returns a row for each brain: source, population, licence, age, size, verdict and warnings.

    Parameters
    ----------
    brains
        id, week, population, source and licence of each, as the configuration has them.
    surfaces : {id: content of its surface.json}
        Brains without one were refused.
    quality : columns subject, verdict, cause, warnings
        The table of quality control, where there is one.
    """
    judged = {} if quality is None else quality.fillna("").set_index("subject").to_dict("index")
    rows = []
    for brain in brains:
        name = str(brain["id"])
        surface, own = surfaces.get(name), judged.get(name, {})
        warnings = [str(text) for text in (surface or {}).get("warnings", [])]
        said = str(own.get("cause") or own.get("warnings") or "; ".join(warnings))
        verdict = own.get("verdict") or ("refused" if surface is None else "look" if warnings else "fine")
        rows.append(
            {
                "brain": name,
                "age": week_label(brain["week"]),
                "source": brain["source"],
                "population": brain["population"] or ("synthetic" if brain["synthetic"] else "not stated"),
                "licence": brain["licence"] or ("made here" if brain["synthetic"] else "your own data"),
                "volume (mL)": np.nan if surface is None else surface["volume_mL"],
                "pial area (cm²)": np.nan if surface is None else surface["area_cm2"]["whole"],
                "verdict": verdict,
                "warnings": said or "none",
            }
        )
    return pd.DataFrame(rows)


def runs_table(
    runs: pd.DataFrame, validation: pd.DataFrame | None = None, displacement: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Returns a row for each run: how it ended, and its scores at the last week that a real brain was compared at.

    Parameters
    ----------
    runs : columns run, subject, start_week, preset, end_week, weeks, min_J, elements_through_cortex,
        order, least_elements_through_cortex, unresolved_from_week, initial_penetration_mm
    validation : the study's table of validation
    displacement : the study's table of the agreement of displacements
    """
    names = run_names(zip(runs["run"], runs["subject"], strict=True))
    rows = []
    for name, (_, run) in zip(names, runs.iterrows(), strict=True):
        row = {"run": name, "start": str(run["subject"]), "preset": run.get("preset"), "verdict": run_verdict(run)}
        of_run = (run["run"], run["start_week"])
        rows.append(row | _scores(_last(validation, of_run, "week"), _last(displacement, of_run, "to_week")))
    return pd.DataFrame(rows)


def run_verdict(run: Mapping[str, Any] | pd.Series) -> str:
    """Returns how a run ended, and what is to be known before its folds are believed."""
    weeks = [float(week) for week in str(run["weeks"]).strip("[]").split(",")]
    reached, end = max(weeks), float(run["end_week"])
    said = [f"reached {week_label(reached)}" if reached >= end - 1e-6 else f"ended at {week_label(reached)} of {end:g}"]
    if run["min_J"] <= 0:
        said.append("elements inverted")
    if too_coarse := resolution_verdict(run):
        said.append(too_coarse)
    if run.get("initial_penetration_mm", 0.0) > DEEP_MM:
        said.append(f"walls of the fissure begin {run['initial_penetration_mm']:.2g} mm beyond their planes")
    return "; ".join(said)


def _last(table: pd.DataFrame | None, of_run: tuple[str, float], week: str) -> Mapping[str, Any]:
    """Returns the row of a run's last week, nothing where there is none."""
    if table is None:
        return {}
    own = table[(table["run"] == of_run[0]) & (table["start_week"] == of_run[1])].sort_values(week)
    return {} if own.empty else {str(name): value for name, value in own.iloc[-1].items()}


def _scores(validation: Mapping[str, Any], displacement: Mapping[str, Any]) -> dict[str, str]:
    """Returns the scores as text, dashes for what was not compared."""

    def shown(name: str, pattern: str, factor: float = 1.0) -> str:
        value = validation.get(name, np.nan)
        return "–" if pd.isna(value) else (pattern % (factor * value)).replace("-", "−")

    gain = shown("gain_shape_index", "%+.2f")
    if gain != "–":
        gain += f" ({shown('gain_low_shape_index', '%+.2f')} to {shown('gain_high_shape_index', '%+.2f')})"
    moved = displacement.get("displacement_r", np.nan)
    return {
        "compared at": week_label(validation["week"]) if validation else "–",
        "kind": str(validation.get("kind", "–")),
        "area, difference (%)": shown("area_difference", "%+.1f", 100),
        "volume, difference (%)": shown("volume_difference", "%+.1f", 100),
        "shape index, r": shown("r_shape_index", "%.2f"),
        "scaled start, r": shown("r_start_shape_index", "%.2f"),
        "gain (95 %)": gain,
        "skill": shown("skill_shape_index", "%.2f"),
        "displacement, r": "–" if pd.isna(moved) else f"{moved:.2f}".replace("-", "−"),
    }


def what_was_done(brains: Sequence[Mapping[str, Any]], runs: pd.DataFrame) -> str:
    """Returns in a few sentences what the study is: its brains, what was folded, and to which age."""
    weeks = sorted({float(brain["week"]) for brain in brains})
    populations = sorted({str(brain["population"]) for brain in brains if brain["population"]})
    synthetic = sum(bool(brain["synthetic"]) for brain in brains)
    span = week_label(weeks[0]) if len(weeks) == 1 else f"{weeks[0]:g} to {week_label(weeks[-1])}"
    of = f" ({'; '.join(populations)})" if populations else ""
    said = [f"{len(brains)} brain{'s' * (len(brains) > 1)} of {span}{of} went in."]
    if synthetic:
        said.append(f"{synthetic} of them {'is' if synthetic == 1 else 'are'} synthetic, not of a fetus.")
    starts = list(dict.fromkeys(runs["subject"]))
    ends = sorted({float(week) for week in runs["end_week"]})
    upto = week_label(ends[0]) if len(ends) == 1 else f"{ends[0]:g} to {week_label(ends[-1])}"
    said.append(
        f"{', '.join(starts)} {'was' if len(starts) == 1 else 'were'} filled with tetrahedra and grown to {upto} in "
        f"{len(runs)} simulation{'s' * (len(runs) > 1)} of cortical folding by differential tangential growth."
    )
    said.append(
        "Simulated and measured brains were measured by the same code with the same settings, and compared where their "
        "weeks and population agree."
    )
    return " ".join(said)
