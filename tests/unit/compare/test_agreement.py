import numpy as np
import pandas as pd

from gyriflow.compare.validation import folding_agreement


def rows(run, subject, week, gyrification, power):
    labels = {"run": run, "subject": subject, "week": week}
    metrics = pd.DataFrame(
        [
            labels | {"hemisphere": side, "metric": name, "value": value}
            for side in ("left", "right")
            for name, value in (("gyrification_index", gyrification), ("volume", 40.0))
        ]
    )
    return metrics, pd.DataFrame([labels | {"hemisphere": "left", "band": 4, "relative_power": power}])


def test_each_simulated_brain_stands_beside_the_real_one_of_its_week():
    brains = [("measured", "a-21", 23, 1.08, 0.3), ("real", "a-23", 23, 1.05, 0.2), ("real", "a-21", 21, 1.01, np.nan)]
    metrics, spectra = (pd.concat(tables) for tables in zip(*(rows(*brain) for brain in brains), strict=True))
    table = folding_agreement(metrics, spectra, [("measured", "a-21", 23.0, "a-23")])
    assert table["metric"].tolist() == ["gyrification_index", "gyrification_index", "spangy_share_B4"]
    assert table["hemisphere"].tolist() == ["left", "right", "left"]
    np.testing.assert_allclose(table["difference"], [0.03, 0.03, 0.1])
    assert set(table["real"]) == {"a-23"}
    assert folding_agreement(metrics, spectra, []).empty
