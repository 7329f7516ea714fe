"""The code that a program depends on: the modules of this package that it imports,
directly or through others."""

import hashlib
import re
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(\.*)([\w.]*)[ \t]+)?import[ \t]+(\([^)]*\)|[^\n]*)",
    re.MULTILINE,
)
"""An import: the dots and the module that it is from, and what it names. Parsing all
files would take half a second."""


def code_hash(program: Path, *modules: Path) -> str:
    """Return "code" and a hash of all modules of this package that a Python program
    imports.

    Further `modules` are those that the program imports by a name that it is given. A
    parameter of a rule, it reruns what depends on a change of the code.
    """
    files = set(modules_behind(program))
    for module in modules:
        files.add(module)
        files |= modules_behind(module)
    text = repr(sorted(map(_name_and_digest, files)))
    digest = hashlib.sha256(text.encode()).hexdigest()
    return f"code {digest[:12]}"


@cache
def modules_behind(program: Path) -> frozenset[Path]:
    """Return the files of all modules of this package that a Python program imports,
    directly or through others.

    A module's C code, in a file of the same name in its folder, is included.
    """
    reached: set[Path] = set()
    waiting = set(imported_modules(program))
    while waiting:
        module = waiting.pop()
        reached.add(module)
        waiting |= imported_modules(module) - reached
    return frozenset(reached - {program})


@cache
def imported_modules(source: Path) -> frozenset[Path]:
    """Return the files of the modules of this package that a source file imports, at
    the top or inside functions."""
    inside = source.resolve().is_relative_to(PACKAGE)
    here = (
        [PACKAGE.name, *source.resolve().relative_to(PACKAGE).parts[:-1]]
        if inside
        else []
    )
    names: list[str] = []
    for dots, module, imported in IMPORT.findall(source.read_text(encoding="utf-8")):
        base = here[: len(here) - len(dots) + 1] if dots else []
        start = ".".join([*base, module] if module else base)
        names += [
            start,
            *(
                f"{start}.{name}" if start else name
                for name in re.findall(r"[\w.]+", imported)
            ),
        ]
    return frozenset(file for name in names for file in _files_of(name))


def subpackage_of(module: Path) -> str:
    """Return the subpackage of a source file: the folder, or the single module,
    directly under the package."""
    return module.resolve().relative_to(PACKAGE).parts[0].removesuffix(".py")


@cache
def _files_of(name: str) -> list[Path]:
    """Return the files of a module of this package and of the packages around it."""
    if name.partition(".")[0] != PACKAGE.name:
        return []
    module = PACKAGE.parent / name.replace(".", "/")
    files = (
        module / "__init__.py",
        module.with_suffix(".py"),
        module.with_suffix(".c"),
    )
    around = _files_of(name.rpartition(".")[0])
    return [*around, *filter(Path.is_file, files)]


@cache
def _name_and_digest(path: Path) -> tuple[str, str]:
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return path.relative_to(PACKAGE).as_posix(), digest
