"""Whose the results in a folder are: those of a study go on, those of another one are not mixed with them."""

import pytest
from configurations import LABELLED

from gyriflow.cli.provenance import require_own_results
from gyriflow.config import load
from gyriflow.errors import InputError


def study(*ids, week=21):
    brains = [{"id": name, "week": week, **LABELLED} for name in ids]
    return load({"brains": brains, "start": ids[0], "folding": {"end_week": 30}})


@pytest.fixture
def made(tmp_path):
    """A folder with results of a study of brains a and b."""
    require_own_results(tmp_path, [tmp_path / "one.yaml"], study("a", "b"), record=True)
    (tmp_path / "results" / "brains" / "a").mkdir(parents=True)
    return tmp_path


def test_another_study_is_refused_with_what_to_do(made):
    with pytest.raises(InputError, match=r"found a of .*one\.yaml; expected c of .*two\.yaml\. Choose .*--directory"):
        require_own_results(made, [made / "two.yaml"], study("c"), record=True)
    # a brain of the same name may be another one
    with pytest.raises(InputError, match="another study"):
        require_own_results(made, [made / "two.yaml"], study("a", week=25), record=False)


@pytest.mark.parametrize(
    ("file", "ids"),
    [("one.yaml", ["c"]), ("two.yaml", ["b", "c"])],
    ids=["the same file, changed", "a copy of it, changed"],
)
def test_a_study_that_was_changed_goes_on(made, file, ids):
    require_own_results(made, [made / file], study(*ids), record=True)
    # whose they are now
    require_own_results(made, [made / file], study(*ids), record=False)


def test_results_that_were_deleted_are_nobodys(made):
    (made / "results" / "brains" / "a").rmdir()
    require_own_results(made, [made / "two.yaml"], study("c"), record=True)
