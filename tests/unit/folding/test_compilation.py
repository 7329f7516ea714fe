"""Where code is compiled, and for which processors."""

from types import SimpleNamespace

import pytest

from gyriflow.folding.compilation import form_compiler


@pytest.mark.fault(79)
def test_ranks_on_different_processors_share_code_that_all_can_execute(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folders = {}
    for processors in (("old", "old"), ("new",), ("old", "new"), ("new", "old")):
        ranks = SimpleNamespace(rank=0, allgather=lambda _, found=processors: found, barrier=lambda: None)
        with form_compiler(ranks) as options:
            folders[processors] = options["cache_dir"]
            assert ("-march=native" in options["cffi_extra_compile_args"]) == (len(set(processors)) == 1)
    assert folders["old", "new"] == folders["new", "old"]
    assert len(set(folders.values())) == 3
