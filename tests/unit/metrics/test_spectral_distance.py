"""Distances between band spectra that are written down by hand."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.metrics.spectral_distance import spectral_distances


def spectrum(
    subject: str, run: str, week: float, powers: list[float], cut_off: int = 7, coarse: int = 7
) -> pd.DataFrame:
    """Returns the table of a hemisphere with the powers of B1 to B6, incomplete or unresolved from these bands on."""
    bands = np.arange(7)
    return pd.DataFrame(
        {
            "subject": subject,
            "run": run,
            "week": week,
            "hemisphere": "left",
            "band": bands,
            "power": [100.0, *powers],
            "complete": bands < cut_off,
            "resolved": bands < coarse,
        }
    )


EVEN = [1.0, 1.0, 2.0, 2.0, 2.0, 2.0]
SHIFTED = [1.0, 1.0, 2.0, 3.0, 3.0, 0.0]


def distance(*spectra: pd.DataFrame) -> pd.Series:
    rows = spectral_distances(pd.concat(spectra, ignore_index=True)).query("run == 'sim'")
    assert len(rows) == 1
    return rows.iloc[0]


def test_all_fold_bands() -> None:
    row = distance(spectrum("a", "sim", 22.0, EVEN), spectrum("b", "real", 23.0, SHIFTED))
    # shares of B4 to B6: 0.2 each against 0.3, 0.3 and 0
    assert row["value"] == pytest.approx(np.sqrt(0.1**2 + 0.1**2 + 0.2**2))
    assert (row["real"], row["real_week"], row["bands"], row["flag"]) == ("b", 23.0, "B4 B5 B6", "ok")


def test_size_of_the_power_does_not_count() -> None:
    row = distance(spectrum("a", "sim", 22.0, [7 * p for p in EVEN]), spectrum("b", "real", 23.0, EVEN))
    assert row["value"] == pytest.approx(0.0, abs=1e-12)


def test_only_bands_that_both_have_count_in_the_shares_too() -> None:
    # B5 is cut off in one, B6 unresolved in the other: what they hold changes nothing
    own, real = [1.0, 1.0, 2.0, 4.0, 99.0, 0.0], [2.0, 2.0, 2.0, 2.0, 0.0, 77.0]
    row = distance(spectrum("a", "sim", 22.0, own, cut_off=5), spectrum("b", "real", 22.0, real, coarse=6))
    assert row["value"] == pytest.approx(4 / 8 - 2 / 8)
    assert (row["bands"], row["flag"]) == ("B4", "not B5 B6")


def test_without_a_fold_band_there_is_no_distance() -> None:
    row = distance(spectrum("a", "sim", 22.0, EVEN, cut_off=4), spectrum("b", "real", 22.0, EVEN))
    assert np.isnan(row["value"])
    assert (row["bands"], row["flag"]) == ("none", "no fold band")


def test_who_is_compared_with_whom() -> None:
    right = spectrum("b", "real", 22.0, EVEN).assign(hemisphere="right")
    known = [spectrum("a", "real", 21.0, EVEN), spectrum("b", "real", 22.0, EVEN), right]
    table = spectral_distances(pd.concat([spectrum("a", "sim", 22.0, EVEN), *known]))
    pairs = table["subject"] + " " + table["run"] + " " + table["hemisphere"] + ", " + table["real"]
    assert sorted(pairs) == ["a real left, b", "a sim left, a", "a sim left, b", "b real left, a"]
    assert set(table["metric"]) == {"spectral_distance"}
    assert set(table["unit"]) == {"1"}
