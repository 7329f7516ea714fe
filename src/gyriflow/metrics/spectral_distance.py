"""Distance between the SpAnGy spectra of two hemispheres."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..geometry.triangles import Floats
from ..parameters.metrics import FOLD_BANDS
from .spangy import BANDS

_HEMISPHERE = ["subject", "run", "week", "hemisphere"]


def spectral_distances(spectra: pd.DataFrame) -> pd.DataFrame:
    """Returns how far the spectrum of each hemisphere is from those of the same side of all measured brains.

    The distance up to band Bk is √Σ(s − s′)² over the fold bands B4 to Bk, where s is the share that a band has of the
    power of B1 to Bk: 0 for equal shares, at most √2. Neither the size of the brain nor the number of modes enters it.
    There is one up to B4, up to B5 and up to B6, each between all pairs whose bands are complete in both.

    Parameters
    ----------
    spectra : columns subject, run, week, hemisphere, band, power, complete, resolved
        `run` is "real" for measured brains.

    Returns
    -------
    DataFrame
        subject, run, week, hemisphere, real (the measured brain), real_week, metric (spectral_distance_B4,
        spectral_distance_B4_to_B5, spectral_distance_B4_to_B6), value, unit, flag ("ok"; "B5 B6 not resolved": in one
        of the two these bands are finer than its edges resolve; "B6 cut off": not complete in one of the two, then
        without a value). A measured brain is not compared with itself.
    """
    complete, resolved, powers = (
        spectra.pivot_table(name, _HEMISPHERE, "band", aggfunc="first").reindex(columns=range(1, BANDS + 1))
        for name in ("complete", "resolved", "power")
    )
    hemispheres = list(complete.index)
    fine = resolved.eq(True).to_numpy()
    whole = powers.reindex(complete.index).where(complete.eq(True)).to_numpy(dtype=float)
    rows = [
        (*own, other[0], other[2], *row)
        for i, own in enumerate(hemispheres)
        for j, other in enumerate(hemispheres)
        if other[1] == "real" and other[3] == own[3] and i != j
        for row in _distances(whole[i], whole[j], fine[i] & fine[j])
    ]
    table = pd.DataFrame(rows, columns=[*_HEMISPHERE, "real", "real_week", "metric", "value", "flag"])
    return table.assign(unit="1")[[*table.columns[:-1], "unit", "flag"]]


def _distances(a: Floats, b: Floats, resolved: NDArray[np.bool_]) -> list[tuple[str, float, str]]:
    """Returns metric, value and flag for the powers of B1 to B6, NaN where a band is not complete."""
    rows = []
    for last in FOLD_BANDS:
        fold = slice(FOLD_BANDS[0] - 1, last)
        shares = a[:last] / a[:last].sum(), b[:last] / b[:last].sum()
        cut = _names(np.isnan(a[:last] + b[:last]))
        coarse = _names(~resolved[:last])
        flag = f"{cut} cut off" if cut else f"{coarse} not resolved" if coarse else "ok"
        name = "spectral_distance_B4" + (f"_to_B{last}" if last > FOLD_BANDS[0] else "")
        rows.append((name, float(np.linalg.norm(shares[0][fold] - shares[1][fold])), flag))
    return rows


def _names(bands: NDArray[np.bool_]) -> str:
    return " ".join(f"B{k + 1}" for k in np.flatnonzero(bands))
