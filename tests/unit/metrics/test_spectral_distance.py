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
TO_B4, TO_B5, TO_B6 = "spectral_distance_B4", "spectral_distance_B4_to_B5", "spectral_distance_B4_to_B6"


def distances(*spectra: pd.DataFrame) -> pd.DataFrame:
    rows = spectral_distances(pd.concat(spectra, ignore_index=True)).query("run == 'sim'").set_index("metric")
    assert rows.index.tolist() == [TO_B4, TO_B5, TO_B6]
    return rows


def test_shares_of_the_bands_up_to_the_last() -> None:
    rows = distances(spectrum("a", "sim", 22.0, EVEN), spectrum("b", "real", 23.0, SHIFTED))
    assert rows["value"][TO_B4] == pytest.approx(3 / 7 - 2 / 6)
    assert rows["value"][TO_B5] == pytest.approx(np.hypot(3 / 10 - 2 / 8, 3 / 10 - 2 / 8))
    # shares of B4 to B6: 0.2 each against 0.3, 0.3 and 0
    assert rows["value"][TO_B6] == pytest.approx(np.sqrt(0.1**2 + 0.1**2 + 0.2**2))
    assert set(rows["flag"]) == {"ok"}
    assert set(zip(rows["real"], rows["real_week"], rows["unit"], strict=True)) == {("b", 23.0, "1")}


def test_size_of_the_power_does_not_count() -> None:
    rows = distances(spectrum("a", "sim", 22.0, [7 * p for p in EVEN]), spectrum("b", "real", 23.0, EVEN))
    np.testing.assert_allclose(rows["value"], 0.0, atol=1e-12)


def test_a_band_that_is_cut_off_in_one_has_no_distance_and_changes_no_other() -> None:
    own, real = [1.0, 1.0, 2.0, 4.0, 99.0, 0.0], [2.0, 2.0, 2.0, 2.0, 0.0, 77.0]
    rows = distances(spectrum("a", "sim", 22.0, own, cut_off=5), spectrum("b", "real", 22.0, real, cut_off=6))
    assert rows["value"][TO_B4] == pytest.approx(4 / 8 - 2 / 8)
    assert rows["value"][[TO_B5, TO_B6]].isna().all()
    assert rows["flag"].tolist() == ["ok", "B5 cut off", "B5 B6 cut off"]


def test_a_band_without_modes_is_cut_off() -> None:
    rows = distances(
        spectrum("a", "sim", 22.0, [1.0, 1.0, 2.0, 2.0, np.nan, np.nan], cut_off=5), spectrum("b", "real", 22.0, EVEN)
    )
    assert rows["value"][TO_B4] == pytest.approx(0.0)
    assert rows["flag"][TO_B6] == "B5 B6 cut off"


def test_bands_finer_than_the_edges_of_one_of_the_two_are_named() -> None:
    rows = distances(spectrum("a", "sim", 22.0, EVEN, coarse=6), spectrum("b", "real", 22.0, SHIFTED, coarse=5))
    assert rows["value"].notna().all()
    assert rows["flag"].tolist() == ["ok", "B5 not resolved", "B5 B6 not resolved"]


def test_who_is_compared_with_whom() -> None:
    right = spectrum("b", "real", 22.0, EVEN).assign(hemisphere="right")
    known = [spectrum("a", "real", 21.0, EVEN), spectrum("b", "real", 22.0, EVEN), right]
    table = spectral_distances(pd.concat([spectrum("a", "sim", 22.0, EVEN), *known]))
    pairs = table["subject"] + " " + table["run"] + " " + table["hemisphere"] + ", " + table["real"]
    assert sorted(set(pairs)) == ["a real left, b", "a sim left, a", "a sim left, b", "b real left, a"]
    assert len(table) == 3 * 4


def test_a_brain_alone_is_compared_with_none() -> None:
    assert spectral_distances(spectrum("a", "real", 21.0, EVEN)).empty
