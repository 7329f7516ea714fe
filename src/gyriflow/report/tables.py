"""Tables of a study, and any table as HTML."""

from collections.abc import Hashable, Mapping
from hashlib import sha256
from html import escape

import numpy as np
import pandas as pd

from .style import MEASURED, PHANTOM, REAL_BRAIN, shown_unit, synthetic_note


def growth_table(rates: pd.DataFrame) -> pd.DataFrame:
    """Returns the growth rates with headings and units for print, one row per interval.

    Parameters
    ----------
    rates : columns series, from_week, to_week, area_ratio, rate_per_s, volume_ratio, core_rate_per_s
        The series is shown where there are several.
    """
    several = len(set(rates["series"])) > 1
    return pd.DataFrame(
        ({"series": rates["series"]} if several else {})
        | {
            "from (GW)": rates["from_week"],
            "to (GW)": rates["to_week"],
            "area ratio": rates["area_ratio"].round(4),
            "tangential rate (10⁻⁷ s⁻¹)": (1e7 * rates["rate_per_s"]).round(3),
            "volume ratio": rates["volume_ratio"].round(4),
            "core rate (10⁻⁷ s⁻¹)": (1e7 * rates["core_rate_per_s"]).round(3),
        }
    )


def sizes_table(areas: pd.DataFrame) -> pd.DataFrame:
    """Returns areas and volumes per week of each series of brains, and how far each is from the first one in %.

    Parameters
    ----------
    areas : columns series, week, area_cm2, volume_ml
        Brains of one week and series count as their mean.
    """
    names = list(dict.fromkeys(areas["series"]))
    columns: dict[str, pd.Series] = {}
    for column, heading, unit in (("area_cm2", "pial area", "cm²"), ("volume_ml", "volume", "mL")):
        wide = areas.pivot_table(index="week", columns="series", values=column, aggfunc="mean")
        columns |= {f"{heading} ({unit}): {name}": wide[name] for name in names}
        for name in names[1:]:
            columns[f"{heading}: {name} − {names[0]} (%)"] = (100 * (wide[name] / wide[names[0]] - 1)).round(1)
    return pd.DataFrame(columns).rename_axis("week (GW)")


def agreement_table(agreement: pd.DataFrame) -> pd.DataFrame:
    """Returns how far the growth rates of series agree, in 10⁻⁷ s⁻¹: a row per interval, their mean, the mean size.

    Parameters
    ----------
    agreement : columns series, reference, from_week, to_week, difference_per_s, core_difference_per_s
    """
    differences = {"difference_per_s": "tangential rate", "core_difference_per_s": "core rate"}
    parts = []
    for series, rows in agreement.groupby("series", sort=False):
        weeks = [f"{a:g}–{b:g}" for a, b in zip(rows["from_week"], rows["to_week"], strict=True)]
        part = pd.DataFrame({"compared": f"{series} − {rows['reference'].iloc[0]}", "interval (GW)": weeks})
        values = (1e7 * rows[list(differences)]).reset_index(drop=True)
        part = part.join(values)
        for label, summary in (("mean", values.mean()), ("mean size", values.abs().mean())):
            part.loc[len(part)] = [part["compared"].iloc[0], label, *summary]
        parts.append(part)
    table = pd.concat(parts, ignore_index=True)
    # a sum with 0 takes the sign from a rounded −0
    table[list(differences)] = table[list(differences)].round(3) + 0.0
    return table.rename(columns={name: f"{text}, difference (10⁻⁷ s⁻¹)" for name, text in differences.items()})


def metrics_table(metrics: pd.DataFrame, *, measured: str = REAL_BRAIN) -> pd.DataFrame:
    """Returns the metrics of whole brains per week: each run, the measured brain, and each run's difference in %.

    Parameters
    ----------
    metrics : columns run, week, hemisphere, metric, value, unit
        `run` is "real" for measured brains; several measured brains of a week give their mean.
    measured
        Heading of the measured brains' column.

    Returns
    -------
    DataFrame indexed by metric (with its unit) and week; cells without a value are NaN
    """
    rows = metrics[metrics["hemisphere"] == "whole"]
    units = rows["unit"].map(shown_unit)
    names = rows["metric"].str.replace("_", " ") + [f" ({unit})" if unit else "" for unit in units]
    order = list(dict.fromkeys(names))
    wide = rows.assign(metric=names).pivot_table(
        index=["metric", "week"], columns="run", values="value", aggfunc="mean", sort=True
    )
    wide = wide.reindex(order, level="metric")
    runs = [run for run in dict.fromkeys(rows["run"]) if run != MEASURED]
    real = wide[MEASURED] if MEASURED in wide else pd.Series(np.nan, index=wide.index)
    columns = {measured: real}
    for run in runs:
        columns[run] = wide[run]
        columns[f"{run}: difference (%)"] = (100 * (wide[run] / real - 1)).round(1)
    return pd.DataFrame(columns)


def region_table(regions: pd.DataFrame, asymmetry: pd.DataFrame) -> pd.DataFrame:
    """Returns metrics by region: a row per brain, run, week and region, left, right and asymmetry of each metric.

    Parameters
    ----------
    regions : columns subject, run, week, hemisphere, region, metric, value, unit
    asymmetry : columns subject, run, week, region, metric, asymmetry_index
    """
    index = ["subject", "run", "week", "region"]
    units = regions["unit"].map(shown_unit)
    names = regions["metric"].str.replace("_", " ") + [f" ({unit})" if unit else "" for unit in units]
    left_right = regions.assign(column=names + ", " + regions["hemisphere"])
    wide = left_right.pivot_table("value", index, "column", aggfunc="first")
    of_regions = asymmetry[asymmetry["region"].isin(set(regions["region"]))]
    indices = of_regions.pivot_table("asymmetry_index", index, "metric", aggfunc="first")
    order = []
    for metric, name in dict(zip(regions["metric"], names, strict=True)).items():
        heading = f"{metric.replace('_', ' ')}, asymmetry"
        wide[heading] = indices.get(metric, np.nan)
        order += [f"{name}, left", f"{name}, right", heading]
    brains = pd.MultiIndex.from_frame(regions[index].drop_duplicates())
    return wide.reindex(index=brains, columns=order).rename_axis(["brain", "run", "week (GW)", "region"])


def runs_table(parameters: Mapping[str, Mapping[str, object]]) -> pd.DataFrame:
    """Returns the parameters of the runs: a row per parameter, a column per run, those that differ first.

    The column "differs" is "yes" for parameters that are not the same in all runs.

    Parameters
    ----------
    parameters : {run: {name: value}}
        Values may be mappings themselves; their names are joined by dots.
    """
    flat = pd.DataFrame({run: pd.Series(_flatten(values), dtype=object) for run, values in parameters.items()})
    shown = flat.map(_shown)
    differs = shown.ne(shown.iloc[:, 0], axis=0).any(axis=1)
    shown.insert(0, "differs", differs.map({True: "yes", False: ""}))
    return shown.loc[[*shown.index[differs], *shown.index[~differs]]].rename_axis("parameter")


def html_table(
    table: pd.DataFrame, *, caption: str, digits: int = 4, synthetic: bool = False, measured: str = PHANTOM
) -> str:
    """Returns the table as HTML with its own look, ready to be put in a page.

    Numbers have `digits` significant digits, missing values are dashes, and all text is escaped. The index is shown
    where it has a name.
    """
    named = any(name is not None for name in table.index.names)
    flat = table.reset_index() if named else table
    heading = caption + (f" ({synthetic_note(measured)})" if synthetic else "")
    styler = (
        flat.style.format(lambda value: _shown(value, digits), na_rep="–", escape="html")
        .format_index(lambda name: str(name), axis=1, escape="html")
        .hide(axis="index")
        .set_caption(escape(heading))
        .set_table_styles(_LOOK)
        .set_table_attributes('class="gyriflow"')
        .set_uuid(sha256(f"{heading}{flat.columns}".encode()).hexdigest()[:8])
    )
    numeric: list[Hashable] = [name for name in flat.columns if pd.api.types.is_numeric_dtype(flat[name])]
    return styler.set_properties(subset=numeric, **{"text-align": "right"}).to_html()


_LOOK: list = [
    {"selector": "", "props": "border-collapse: collapse; font: 13px sans-serif; margin: 1em 0"},
    {"selector": "caption", "props": "caption-side: top; text-align: left; font-weight: bold; padding: 4px 0"},
    {"selector": "th", "props": "text-align: left; border-bottom: 1px solid #444; padding: 3px 10px"},
    {"selector": "td", "props": "border-bottom: 1px solid #ddd; padding: 3px 10px"},
]


def _flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    flat: dict[str, object] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat.update(_flatten(value, f"{prefix}{name}."))
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _shown(value: object, digits: int = 6) -> str:
    match value:
        case bool() | np.bool_():
            return "yes" if value else "no"
        case float() | np.floating():
            return "–" if np.isnan(value) else f"{value:.{digits}g}"
        case None:
            return "–"
        case list() | tuple():
            return ", ".join(_shown(item, digits) for item in value)
        case _:
            return str(value)
