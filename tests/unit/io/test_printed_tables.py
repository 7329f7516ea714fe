"""One table as CSV, Markdown and LaTeX."""

import numpy as np
import pandas as pd
import pytest

from gyriflow.io.figures import as_printed, write_printed
from gyriflow.io.files import read_table

TABLE = pd.DataFrame({"rate (1/s)": [2.0e-7, np.nan], "a_b": ["50 % & more", ""], "n": [1234567, 3]})


@pytest.fixture
def paths(tmp_path):
    return {kind: tmp_path / f"table.{kind}" for kind in ("csv", "md", "tex")}


def test_csv_keeps_all_digits_and_the_others_those_of_print(paths):
    table = TABLE.assign(third=[1 / 3, 2 / 3])
    write_printed(paths, table, "Rates, cm²")
    np.testing.assert_allclose(read_table(paths["csv"])["third"], [1 / 3, 2 / 3], rtol=1e-9)
    rows = [line.split("|")[1:-1] for line in paths["md"].read_text().splitlines() if line.startswith("|")]
    assert [cell.strip() for cell in rows[0]] == ["rate (1/s)", "a_b", "n", "third"]
    assert [cell.strip() for cell in rows[2]] == ["2e-07", "50 % & more", "1 234 567", "0.3333"]
    assert [cell.strip() for cell in rows[3]] == ["–", "–", "3", "0.6667"]
    assert paths["md"].read_text().startswith("Rates, cm²\n")


def test_latex_has_rules_and_no_bare_marks(paths):
    write_printed(paths, TABLE, "Rates, cm²")
    text = paths["tex"].read_text()
    assert r"\toprule" in text
    assert r"\caption{Rates, cm\textsuperscript{2}}" in text
    assert r"a\_b" in text
    assert r"50 \% \& more" in text
    assert text.isascii()


def test_another_form_is_printed_where_it_is_given(paths):
    write_printed(paths, TABLE, "x", printed=pd.DataFrame({"other": [1.0]}))
    assert "other" in paths["md"].read_text()
    assert "other" in paths["tex"].read_text()
    assert "other" not in paths["csv"].read_text()


@pytest.mark.parametrize(("value", "text"), [(np.float64(0.5), "0.5"), (np.bool_(True), "True"), (True, "yes"),
                                             (None, "–"), (np.nan, "–"), ("x", "x")])  # fmt: skip
def test_cells(value, text):
    assert as_printed(value) == text
