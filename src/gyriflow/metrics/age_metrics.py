"""The metrics for apparent age: comparable between brains, of size or free of it."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..errors import InputError
from ..units import ML_PER_MM3

BRAIN = ["subject", "run", "week"]
"""The columns that name a brain."""

MEASURED = "real"
"""The run of measured brains."""

OF_THE_ANALYSIS = (
    *("crossing_faces", "curvature_radius", "spangy_modes", "spangy_captured_share", "weyl_number"),
    "thickness_measured_share",
)
"""Rows of the table of metrics that describe the surface's faces and the analysis rather than the folds."""

OF_LABELS = ("volume_tissue", "volume_ventricles", "volume_cortex")
"""Metrics of the labels, which simulated brains do not have."""

FAMILIES = {
    "size": ("volume", "area"),
    "gyrification": ("gyrification_",),
    "depth": ("mean_sulcal_depth", "sulcal_depth_"),
    "thickness": ("mean_thickness", "thickness_"),
    "spectrum": ("spangy_",),
}
"""Families of metrics by how their names begin; all others are of curvature. One says much of what the others say."""


def family(metric: str) -> str:
    """Returns the family of a metric."""
    return next((name for name, starts in FAMILIES.items() if metric.startswith(starts)), "curvature")


DIMENSIONS = {"mm": 1, "cm": 1, "mm2": 2, "cm2": 2, "mm3": 3, "mL": 3, "1/mm": -1, "1/mm2": -2, "1": 0, "deg": 0}
"""The power of length in each unit. A metric is free of size where it is 0: a brain scaled up keeps it."""


def comparable_metrics(metrics: pd.DataFrame, spectra: pd.DataFrame, reference: Sequence[str]) -> pd.DataFrame:
    """Returns the metrics that can be compared between brains, as measured and derived from those.

    Powers of bands that are cut off or not resolved are left out. Two kinds, both free of size, are added:
    `…_scaled`, each metric with a length in its unit divided by that power of the cube root of the volume; and
    `spangy_B…_share`, a band's fraction of the power of the bands from B1 to the highest that is complete and resolved
    in all reference brains. Metrics that only hemispheres have are given to the whole brain as their mean.

    Parameters
    ----------
    metrics : columns subject, run, week, hemisphere, metric, value, unit
    spectra : columns subject, run, week, hemisphere, band, complete, resolved
    reference
        Subjects. All their measured brains have every metric that is returned.

    Returns
    -------
    DataFrame
        subject, run, week, hemisphere, metric, value, size (whether it is a metric of size), reference (whether the
        brain is a reference brain); no rows without a value.

    InputError for a unit whose dimension is not known.
    """
    chosen = metrics[
        ~metrics["metric"].isin((*OF_THE_ANALYSIS, *OF_LABELS)) & ~metrics["metric"].str.endswith("_relative_power")
    ]
    units = chosen.drop_duplicates("metric").set_index("metric")["unit"].astype(str)
    if unknown := sorted(set(units) - set(DIMENSIONS)):
        raise InputError("units without a known dimension", found=", ".join(unknown), expected=", ".join(DIMENSIONS))
    dimensions = units.map(DIMENSIONS)
    wide = chosen.pivot_table("value", [*BRAIN, "hemisphere"], "metric", aggfunc="first")
    powers = _trusted_powers(wide, spectra)
    wide[powers.columns] = powers
    brains = wide.index.to_frame()
    known = ((brains["run"] == MEASURED) & brains["subject"].isin(reference)).to_numpy()
    lengths = np.cbrt(wide["volume"] / ML_PER_MM3)
    scaled = {
        f"{metric}_scaled": wide[metric] / lengths**power
        for metric, power in dimensions.items()
        if power and metric != "volume" and metric in wide
    }
    wide = pd.concat([wide, pd.DataFrame(scaled), _band_shares(powers, known)], axis=1)
    values = wide.reset_index().melt([*BRAIN, "hemisphere"], var_name="metric", value_name="value").dropna()
    values = _with_means_of_sides(values)
    values["size"] = values["metric"].map(dimensions).fillna(0) != 0
    values["reference"] = (values["run"] == MEASURED) & values["subject"].isin(reference)
    number = values.loc[values["reference"], "subject"].nunique()
    has_all = values.groupby(["hemisphere", "metric"])["reference"].transform("sum") == number
    return values[has_all].reset_index(drop=True)


def _trusted_powers(wide: pd.DataFrame, spectra: pd.DataFrame) -> pd.DataFrame:
    """Returns the columns of the powers of bands, NaN where a band is cut off or not resolved."""
    trusted = spectra.assign(trusted=spectra["complete"] & spectra["resolved"]).pivot_table(
        "trusted", [*BRAIN, "hemisphere"], "band", aggfunc="first"
    )
    trusted = trusted.reindex(wide.index).eq(True).rename(columns=lambda band: f"spangy_B{band}_power")
    present = [name for name in trusted if name in wide]
    return wide[present].where(trusted[present])


def _band_shares(powers: pd.DataFrame, known: NDArray[np.bool_]) -> pd.DataFrame:
    """Returns the share of each band in the power of the bands that all known hemispheres have, B0 left out."""
    hemispheres = powers[known & (powers.index.get_level_values("hemisphere") != "whole")]
    bands = powers.drop(columns="spangy_B0_power", errors="ignore")
    common = bands.loc[:, hemispheres[bands.columns].notna().all()]
    # a brain that lacks one of them has no total to compare with
    shares = common.div(common.sum(axis=1, skipna=False), axis=0)
    return shares.rename(columns=lambda name: name.replace("_power", "_share"))


def _with_means_of_sides(values: pd.DataFrame) -> pd.DataFrame:
    """Returns the values with the mean of left and right for the whole where it has none of its own."""
    sides = values[values["hemisphere"] != "whole"].groupby([*BRAIN, "metric"], sort=False)["value"]
    # of the only one where there is one
    means = sides.mean()[sides.count() == sides.size()].reset_index().assign(hemisphere="whole")
    return pd.concat([values, means]).drop_duplicates([*BRAIN, "hemisphere", "metric"])
