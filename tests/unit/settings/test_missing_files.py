"""A missing file is answered with those that have its name and another ending."""

import pytest

from gyriflow.formats import ALL_SUFFIXES
from gyriflow.settings.base import hint_for_missing


@pytest.mark.parametrize("suffix", ALL_SUFFIXES)
def test_a_file_of_another_format_is_named_whatever_its_ending(tmp_path, suffix):
    (tmp_path / f"Brain{suffix}").touch()
    (tmp_path / "other.txt").touch()
    assert hint_for_missing(tmp_path / "brain") == f"; there is Brain{suffix}"
