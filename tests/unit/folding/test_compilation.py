"""Where code is compiled, and for which processors."""

import pytest

from gyriflow.folding.compilation import form_compiler


class Ranks:
    """The first rank of a communicator whose ranks are on some processors."""

    rank = 0

    def __init__(self, *processors):
        self.processors = processors

    def allgather(self, own):
        return self.processors

    def barrier(self):
        pass


@pytest.mark.fault(80)
def test_ranks_on_different_processors_share_code_that_all_can_execute(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folders = {}
    for processors in (("old", "old"), ("new",), ("old", "new"), ("new", "old")):
        with form_compiler(Ranks(*processors)) as options:
            folders[processors] = options["cache_dir"]
            is_native = "-march=native" in options["cffi_extra_compile_args"]
            assert is_native == (len(set(processors)) == 1)
    assert folders["old", "new"] == folders["new", "old"]
    assert len(set(folders.values())) == 3
