"""Distance between the SpAnGy spectra of two hemispheres."""

import numpy as np
import pandas as pd

from ..geometry.triangles import Floats
from .spangy import BANDS

FOLD_BANDS = (4, 5, 6)
"""The bands of primary, secondary and tertiary folds."""

_HEMISPHERE = ["subject", "run", "week", "hemisphere"]


def spectral_distances(spectra: pd.DataFrame) -> pd.DataFrame:
    """Returns how far the spectrum of each hemisphere is from those of the same side of all measured brains.

    The distance is √Σ(s − s′)² over the fold bands, where s is the share that a band has of the power of the bands
    from B1 on. Only bands that are complete and resolved in both spectra count, in the shares too: 0 for equal shares,
    at most √2. Neither the size of the brain nor the number of modes enters it. With fewer fold bands it is smaller;
    compare distances of the same bands.

    Parameters
    ----------
    spectra : columns subject, run, week, hemisphere, band, power, complete, resolved
        `run` is "real" for measured brains.

    Returns
    -------
    DataFrame
        subject, run, week, hemisphere, real (the measured brain), real_week, metric (spectral_distance), value, unit,
        bands (such as "B4 B5", or "none"), flag ("ok" for B4 to B6; "not B6", "not B5 B6" for what is left out; "no
        fold band", then without a value). A measured brain is not compared with itself.
    """
    powers = _powers(spectra)
    rows = [
        (*brain, other[0], other[2], *_distance(own, theirs))
        for brain, own in powers.items()
        for other, theirs in powers.items()
        if other[1] == "real" and other[3] == brain[3] and other != brain
    ]
    columns = [*_HEMISPHERE, "real", "real_week", "value", "bands", "flag"]
    table = pd.DataFrame(rows, columns=columns).assign(metric="spectral_distance", unit="1")
    return table[[*columns[:6], "metric", "value", "unit", "bands", "flag"]]


def _powers(spectra: pd.DataFrame) -> dict[tuple, Floats]:
    """Returns for each hemisphere the powers of the bands B1 to B6, NaN where a band is cut off or not resolved."""
    powers: dict[tuple, Floats] = {}
    for *hemisphere, band, power, complete, resolved in spectra[
        [*_HEMISPHERE, "band", "power", "complete", "resolved"]
    ].itertuples(index=False, name=None):
        own = powers.setdefault(tuple(hemisphere), np.full(BANDS, np.nan))
        if band > 0 and complete and resolved:
            own[band - 1] = power
    return powers


def _distance(a: Floats, b: Floats) -> tuple[float, str, str]:
    """Returns the distance of the powers of the bands B1 to B6, the bands that it is over, and its flag."""
    common = np.isfinite(a) & np.isfinite(b)
    # bands end at the first that one of them lacks
    last = int(np.argmin(common)) if not common.all() else BANDS
    over = [band for band in FOLD_BANDS if band <= last]
    if not over:
        return np.nan, "none", "no fold band"
    shares = a[:last] / a[:last].sum(), b[:last] / b[:last].sum()
    fold = np.array(over) - 1
    lacking = [f"B{band}" for band in FOLD_BANDS if band > last]
    flag = " ".join(["not", *lacking]) if lacking else "ok"
    return float(np.linalg.norm(shares[0][fold] - shares[1][fold])), " ".join(f"B{band}" for band in over), flag
