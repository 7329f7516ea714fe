"""Which modules a program of the workflow depends on."""

import pytest

from gyriflow.io import sources
from gyriflow.io.sources import code_hash, imported_modules, modules_behind, room_of


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A small package of two rooms and a plain module, with a program beside it."""
    root = tmp_path / "src" / "gyriflow"
    contents = {
        "__init__.py": "",
        "units.py": "ML = 1",
        "surface/__init__.py": "",
        "surface/repair.py": "from ..units import ML",
        "surface/labels.py": "def read():\n    from .repair import ML",
        "mesh/__init__.py": "import numpy",
        "mesh/quality.py": "import gyriflow.units",
        "mesh/fill.py": "from .. import (\n    surface,  # one\n    units as u,\n)\nimport gyriflow.unused as o",
        "unused.py": "",
    }
    for name, text in contents.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    monkeypatch.setattr(sources, "PACKAGE", root)
    sources._files_of.cache_clear()
    yield root
    sources._files_of.cache_clear()


def test_modules_behind_a_program_are_followed_through_others(package, tmp_path):
    program = tmp_path / "measure.py"
    program.write_text("from gyriflow.surface.labels import read")
    names = {path.relative_to(package).as_posix() for path in modules_behind(program)}
    assert names == {"__init__.py", "surface/__init__.py", "surface/labels.py", "surface/repair.py", "units.py"}


def test_imports_of_other_functions_do_not_count_where_one_is_named(package, tmp_path):
    program = tmp_path / "draw.py"
    program.write_text(
        "import gyriflow.units\n\n\ndef one(\n    a,\n) -> None:\n    from gyriflow.mesh import quality\n\n\n"
        "def one_more():\n    import gyriflow.unused\n"
    )
    for function, rooms in (("one", {"units", "mesh"}), ("one_more", {"units", "unused"})):
        assert {room_of(path) for path in imported_modules(program, function)} - {"__init__"} == rooms


def test_a_change_of_a_module_changes_the_hash(package, tmp_path):
    program = tmp_path / "judge.py"
    program.write_text("from gyriflow.mesh import quality")
    hashes = {code_hash(program)}
    for name in ("unused.py", "mesh/quality.py"):
        (package / name).write_text((package / name).read_text() + "\n# another line")
        for remembered in (sources._digest, sources._files_of, sources.imported_modules):
            remembered.cache_clear()
        hashes.add(code_hash(program))
        assert len(hashes) == {"unused.py": 1, "mesh/quality.py": 2}[name]
