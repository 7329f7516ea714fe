"""`./run python tests/demo_numbers.py [DIRECTORY]`: whether the demo has the results that it had, for `.ci/run`."""

import sys
from pathlib import Path

import pandas as pd

EXPECTED = {
    ("reference", 23): {"area_cm2": 108.9, "volume_ml": 55.56, "r_shape_index": 0.529},
    ("reference", 25): {"area_cm2": 136.1, "volume_ml": 67.27, "r_shape_index": 0.339},
    ("measured", 23): {"area_cm2": 111.7, "volume_ml": 63.47, "r_shape_index": 0.830},
    ("measured", 25): {"area_cm2": 137.8, "volume_ml": 85.36, "r_shape_index": 0.804},
}
REAL = {23: {"real_area_cm2": 112.1, "real_volume_ml": 63.48}, 25: {"real_area_cm2": 139.9, "real_volume_ml": 85.27}}
RELATIVE, ABSOLUTE_R = 0.01, 0.03


def main(directory: Path) -> int:
    """Print each value that is off, and return the exit code."""
    table = pd.read_csv(directory / "results" / "study" / "validation.csv").set_index(["run", "week"])
    wrong = 0
    for (run, week), values in EXPECTED.items():
        for name, expected in (values | REAL[week]).items():
            found = float(table.loc[(run, week), name])
            tolerance = ABSOLUTE_R if name.startswith("r_") else RELATIVE * expected
            # a missing value is no value within the tolerance
            if not abs(found - expected) <= tolerance:
                print(f"{run} at {week} GW: {name} is {found:.4g}; expected {expected:g} to {tolerance:.2g}")
                wrong += 1
    print(f"{wrong} of the demo's numbers are off" if wrong else "the demo's numbers are as expected")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else ".")))
