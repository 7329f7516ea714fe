"""What the brains that a finished study has foretold are worth, beside simpler ways to foretell them.

    ./run python benchmarks/prediction.py STUDY_FOLDER

STUDY_FOLDER is as for benchmarks/validation.py. The last line is one JSON object, a list under `predictions`: for each
run, start, horizon and week `r_shape_index`, `distance_mm`, `distance95_mm`, `area_error`, `volume_error`,
`crossing_faces`, `roughness_ratio` and `skill` of the run, and the same for each simpler way under its name.
"""

import argparse
import json
from pathlib import Path

from gyriflow.errors import InputError
from gyriflow.io.files import read_table

COLUMNS = ["r_shape_index", "distance_mm", "distance95_mm", "area_error", "volume_error"]
COLUMNS += ["crossing_faces", "roughness_ratio", "skill"]
KEYS = ["run", "start", "horizon", "week"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", type=Path)
    study = parser.parse_args().study
    places = [folder / "prediction.csv" for folder in (study / "results" / "study", study / "study", study)]
    path = next((place for place in places if place.is_file()), None)
    if path is None:
        raise InputError("has no prediction.csv", path=study, remedy="Run a study with the preset expected first.")
    table = read_table(path)
    print(table[[*KEYS, "model", *COLUMNS]].to_string(index=False, float_format="%.3f"))
    found = []
    for keys, rows in table.groupby(KEYS):
        models = json.loads(rows.set_index("model")[COLUMNS].to_json(orient="index"))
        found.append(dict(zip(KEYS, keys, strict=True)) | models.pop("run") | models)
    print(json.dumps({"predictions": found}))


if __name__ == "__main__":
    main()
