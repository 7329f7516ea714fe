import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from gyriflow.compare.validation import Comparison, ordered, validation_row
from gyriflow.geometry.triangles import area, signed_volume, transformed

sys.path.insert(0, str(Path(__file__).parent))
from bumpy import bumpy, shaped

ROOT = Path(__file__).parents[3]
REAL, START = bumpy(1), bumpy(2)
SHAPES = {"real": shaped(REAL), "start": shaped(START), "adjacent": shaped(bumpy(1, height=0.8))}


def row(week: float, *, grown: float = 1.0, run: str = "measured") -> dict:
    simulated = transformed(REAL, np.diag([grown] * 3 + [1.0]))
    return validation_row(
        Comparison(run, "predicted", 21.0, week),
        simulated=simulated,
        real_brain=REAL,
        curve=(area(REAL), signed_volume(REAL)),
        run=SHAPES["real"],
        **SHAPES,
    )


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    rows = [row(23.0, grown=1.02), row(22.0)]
    rows.append(row(22.0, run="reference") | {"curve_area_cm2": np.nan, "area_error": np.nan, "volume_error": np.nan})
    return ordered(rows)


MOVES = pd.DataFrame(
    {
        "run": "measured",
        "start_week": 21.0,
        "from_week": [21.0, 22.0],
        "to_week": [22.0, 23.0],
        "displacement_r": [0.5, 0.8],
        "displacement_slope": [0.6, 0.9],
    }
)


def test_a_row_holds_sizes_errors_placement_and_folds():
    found = row(23.0, grown=1.02)
    assert found["horizon"] == 2
    assert found["area_error"] == pytest.approx(1.02**2 - 1)
    assert found["volume_difference"] == pytest.approx(1.02**3 - 1)
    assert found["relative_area"] == pytest.approx(found["real_relative_area"])
    assert found["r_shape_index"] == pytest.approx(1.0)
    assert found["skill_shape_index"] > 1.0
    # as they are, not scaled: a fiftieth of the radius apart everywhere
    assert found["distance_mm"] == pytest.approx(0.02 * np.linalg.norm(REAL.vertices, axis=1).mean(), rel=0.05)
    assert found["distance95_mm"] > found["distance_mm"]
    assert 0.7 < found["cortex_dice"] < row(23.0)["cortex_dice"] == 1.0
    assert found["curvature_rms_ratio"] == pytest.approx(1.0)


def test_rows_are_ordered_and_named_first(table):
    assert table.columns[:5].tolist() == ["run", "kind", "start_week", "week", "horizon"]
    assert table.columns[5:8].tolist() == ["distance_mm", "distance95_mm", "cortex_dice"]
    assert table[["run", "week"]].to_numpy().tolist() == [
        ["measured", 22.0],
        ["measured", 23.0],
        ["reference", 22.0],
    ]


def test_the_benchmark_prints_the_summary_of_a_study(tmp_path, table):
    folder = tmp_path / "results" / "study"
    folder.mkdir(parents=True)
    table.to_csv(folder / "validation.csv", index=False)
    MOVES.to_csv(folder / "displacement_agreement.csv", index=False)
    command = [sys.executable, str(ROOT / "benchmarks" / "validation.py"), str(tmp_path)]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = json.loads(printed.splitlines()[-1])
    assert list(found) == ["measured", "reference"]
    measured = found["measured"]
    assert measured["kind"] == "predicted"
    assert measured["worst_area_error"] == pytest.approx(1.02**2 - 1)
    assert measured["worst_volume_error"] == pytest.approx(1.02**3 - 1)
    assert measured["last_week"] == 23
    assert measured["skill_shape_index"] == pytest.approx(table["skill_shape_index"].iloc[1])
    assert measured["curvature_rms_ratio"] == pytest.approx(1.0)
    assert (measured["displacement_r"], measured["displacement_slope"]) == (0.8, 0.9)
    first, second = measured["horizon"]["predicted"].values()
    assert first["gain_shape_index"] == pytest.approx(table["gain_shape_index"].iloc[0])
    # at horizon 1 there is no skill
    assert first["skill_shape_index"] is None
    assert second["skill_shape_index"] == pytest.approx(table["skill_shape_index"].iloc[1])
    assert found["reference"]["worst_area_error"] is None
    assert found["reference"]["displacement_r"] is None
