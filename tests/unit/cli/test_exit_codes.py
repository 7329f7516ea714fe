"""The code in which a run ends: that of the first failed step, or of a full disk that left none."""

import shutil
from collections import namedtuple

import pytest

from gyriflow.cli.launch import exit_code

Usage = namedtuple("Usage", "total used free")


@pytest.mark.fault(36)
@pytest.mark.parametrize(
    ("code", "recorded", "free", "expected"),
    [(0, None, 0, 0), (1, None, 2**20, 5), (1, 1, 2**20, 5), (1, 2, 2**20, 2), (1, None, 2**30, 1), (1, 3, 2**30, 3)],
)
def test_a_full_disk_is_the_cause_where_no_step_has_told_another(
    tmp_path, monkeypatch, capsys, code, recorded, free, expected
):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: Usage(2**31, 2**31 - free, free))
    assert exit_code(code, recorded, tmp_path) == expected
    assert ("the disk is full" in capsys.readouterr().err) == (expected == 5)
