"""Spectra of folds of a known wavelength."""

import numpy as np
import pandas as pd

from gyriflow.metrics.spangy import PART_POWERS


def folded(thickness: float) -> pd.DataFrame:
    """Return made spectra of folds whose wavelength is 6 thicknesses, in bands of a
    brain with λ1 = (2π/128 mm)²."""
    bands = np.arange(1, 7)
    power = np.exp(-((np.log2(128 / (6 * thickness)) - bands + 0.5) ** 2))
    table = pd.DataFrame(
        {"band": bands, "power": power, "relative_power": power / power.sum()}
    )
    table = table.assign(
        wavelength_min_mm=128 / 2.0**bands,
        wavelength_max_mm=256 / 2.0**bands,
        is_open=False,
    )
    octaves = np.arange(0.5, 16 * 6).reshape(6, 16) / 16
    table[PART_POWERS] = np.exp(-((np.log2(128 / (6 * thickness)) - octaves) ** 2))
    return table.assign(
        hemisphere="left", proxy="mean_curvature", complete=True, resolved=True
    )
