"""`./run python tests/demo_numbers.py [DIRECTORY]`: whether the demo has the results
that it had, for `.ci/run`."""

import sys
from pathlib import Path

import pandas as pd

EXPECTED = {
    ("reference", 27): {
        "area_cm2": 174.0,
        "volume_ml": 106.6,
        "r_shape_index": 0.455,
        "gain_shape_index": -0.020,
    },
    ("reference", 29): {
        "area_cm2": 215.5,
        "volume_ml": 130.7,
        "r_shape_index": 0.274,
        "gain_shape_index": -0.092,
    },
    ("measured", 27): {
        "area_cm2": 182.7,
        "volume_ml": 125.6,
        "r_shape_index": 0.979,
        "gain_shape_index": 0.497,
    },
    ("measured", 29): {
        "area_cm2": 250.3,
        "volume_ml": 181.6,
        "r_shape_index": 0.979,
        "gain_shape_index": 0.625,
    },
}
OBSERVED = {
    27: {"observed_area_cm2": 183.2, "observed_volume_ml": 125.8},
    29: {"observed_area_cm2": 250.7, "observed_volume_ml": 181.9},
}
RELATIVE, ABSOLUTE_R = 0.01, 0.03


def main(directory: Path) -> int:
    """Print each value that is off, and return the exit code."""
    table = pd.read_csv(directory / "results" / "study" / "validation.csv").set_index(
        ["run", "week"]
    )
    wrong = 0
    for (run, week), values in EXPECTED.items():
        for name, expected in (values | OBSERVED[week]).items():
            found = float(table.loc[(run, week), name])
            tolerance = (
                ABSOLUTE_R if name.startswith(("r_", "gain_")) else RELATIVE * expected
            )
            # a missing value is no value within the tolerance
            if not abs(found - expected) <= tolerance:
                print(
                    f"{run} at {week} GW: {name} is {found:.4g}; expected {expected:g}"
                    f" to {tolerance:.2g}"
                )
                wrong += 1
    print(
        f"{wrong} of the demo's numbers are off"
        if wrong
        else "the demo's numbers are as expected"
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else ".")))
