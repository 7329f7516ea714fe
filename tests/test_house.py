"""The house rules, checked on the source itself: import arrows, open files, names, and
lists that must agree."""

import ast
import importlib.util
import json
import re
import sys
import tomllib
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from string import Formatter

import pytest
import yaml

from gyriflow.code_hash import imported_modules, subpackage_of
from gyriflow.running.requirements import EXTRAS, LIBRARIES
from gyriflow.study import paths
from gyriflow.version import RELEASE

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "gyriflow"

GROUND = {
    "errors",
    "units",
    "quantities",
    "formats",
    "names",
    "splines",
    "grouping",
    "memory",
}
PLAIN = GROUND | {"geometry", "settings"}
"""What every room may import: errors and messages, units, quantities, formats of files,
plain geometry and settings."""
ARROWS = {
    "errors": set(),
    "units": set(),
    "quantities": set(),
    "formats": set(),
    "names": {"errors"},
    "grouping": set(),
    "memory": set(),
    "splines": set(),
    "code_hash": set(),
    "shipped": set(),
    "version": {"shipped"},
    "messages": {"errors"},
    "step": {"errors", "memory", "messages"},
    # names of label schemes and atlases are names of shipped files
    "settings": GROUND | {"shipped"},
    "geometry": {"errors", "units"},
    "mechanics": set(),
    **dict.fromkeys(("io", "mesh", "growth", "metrics", "report"), PLAIN),
    # brains are compared by what is measured on them
    "compare": PLAIN | {"metrics"},
    # surfaces are posed by those of the shipped atlas
    "anatomy": PLAIN | {"io", "shipped"},
    # the solver is a program of its own, with its own frames and checkpoints
    "folding": PLAIN | {"mechanics", "io", "code_hash"},
    "study": PLAIN | {"io", "shipped", "version"},
    "running": (
        PLAIN
        | {"code_hash", "messages", "shipped", "step", "version"}
        | {"study", "anatomy", "folding", "io"}
    ),
    "cli": (
        PLAIN
        | {"code_hash", "shipped", "version"}
        | {"running", "study", "anatomy", "io"}
    ),
}
"""The rooms, and what each may import besides itself. Siblings meet in plain geometry,
settings and files."""
PROGRAM_ARROWS = {"io", "messages", "step"}
"""What the program of a room (`__main__.py`) may import beyond that."""

SOURCES = sorted(PACKAGE.rglob("*.py"))
SCRIPTS = sorted((ROOT / "workflow" / "scripts").glob("*.py"))
PROGRAMS = [
    *SCRIPTS,
    *(ROOT / "benchmarks").rglob("*.py"),
    *(ROOT / "atlases").rglob("*.py"),
]
RULE_FILES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]

OPENING_ROOMS = {"code_hash", "io", "folding", "running", "cli", "messages", "step"}
OPENS_A_FILE = re.compile(
    r"""(?<![\w.])open\(
    | \.(open|(read|write)_(text|bytes)|tofile|to_filename|savefig)\(
    | \.(to_(csv|json|hdf|parquet|pickle)|(load_new|save_current)_mesh)\(
    | \bnp\.(load|save|genfromtxt|fromfile|memmap)\w*\(
    | \b(pd\.read_\w+|nib\.(load|save)|trimesh\.load\w*|h5py\.File)\(
    | \bpv\.(read|save_meshio|get_reader)\(
    | \bshutil\.(copy\w*|move)\(""",
    re.VERBOSE,
)
PIPES = "mesh/meshers.py"
"""A module that sends arrays to a program, and opens no file."""


def rooms_imported(path: Path) -> set[str]:
    """Return the other rooms of gyriflow that a source file imports, at the top or
    inside functions."""
    return {subpackage_of(module) for module in imported_modules(path)} - {
        subpackage_of(path),
        "__init__",
    }


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def short(path: Path) -> str:
    return str(path.relative_to(ROOT))


def is_program(path: Path) -> bool:
    return path.name == "__main__.py"


def test_rooms_import_only_what_is_below_them():
    upwards = {
        short(path): forbidden
        for path in SOURCES
        if subpackage_of(path) != "__init__"
        if (
            forbidden := rooms_imported(path)
            - ARROWS[subpackage_of(path)]
            - (PROGRAM_ARROWS if is_program(path) else set())
        )
    }
    assert upwards == {}


def test_allowed_arrows_make_no_circle():
    TopologicalSorter(ARROWS).prepare()


def test_mechanics_is_ufl_only():
    lines = "".join(path.read_text() for path in (PACKAGE / "mechanics").glob("*.py"))
    imported = set(re.findall(r"^\s*(?:import|from) (\w+)", lines, re.MULTILINE))
    assert imported <= {"ufl", "abc", "collections", "dataclasses", "typing", "math"}


def test_only_io_and_folding_open_files():
    opening = []
    for path in SOURCES:
        may_open = subpackage_of(path) in OPENING_ROOMS or is_program(path)
        if may_open or short(path).endswith(PIPES):
            continue
        lines = path.read_text().splitlines()
        opening += [(short(path), line) for line in lines if OPENS_A_FILE.search(line)]
    assert opening == []


@pytest.mark.parametrize("code", ["open('a')", "with h5py.File('a'): pass"])
def test_opened_files_are_seen(code):
    assert OPENS_A_FILE.search(code)


def test_scripts_read_call_and_write():
    # numbers are computed in the package, where fast tests reach them; matrices of
    # poses may be multiplied
    arithmetic = ast.Sub | ast.Mult | ast.Pow | ast.Mod | ast.FloorDiv
    computed = [
        f"{short(path)}:{node.lineno}: {ast.unparse(node)}"
        for path in SCRIPTS
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.While)
        or (isinstance(node, ast.BinOp) and isinstance(node.op, arithmetic))
    ]
    assert computed == []


def test_every_script_is_used_and_there():
    text = "\n".join(path.read_text() for path in RULE_FILES)
    assert set(re.findall(r"\.\./scripts/(\w+\.py)", text)) == {
        path.name for path in SCRIPTS
    }


def test_what_scripts_and_benchmarks_import_is_there():
    # imports within functions too, which only a job would otherwise try
    imported = [
        (path.name, node.module, alias.name)
        for path in PROGRAMS
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.ImportFrom)
        and (node.module or "").startswith("gyriflow")
        for alias in node.names
    ]
    without = [
        row for row in imported if not hasattr(importlib.import_module(row[1]), row[2])
    ]
    assert [
        row for row in without if importlib.util.find_spec(f"{row[1]}.{row[2]}") is None
    ] == []


def wildcards_and_names(call: ast.Call) -> tuple[set[str], set[str]] | None:
    """Return the wildcards of a pattern of results and the names that a call of format
    gives them; None for other calls."""
    called = call.func
    if not isinstance(called, ast.Attribute) or called.attr != "format":
        return None
    by_name = isinstance(called.value, ast.Name)
    pattern = getattr(paths, called.value.id, None) if by_name else None
    if not isinstance(pattern, str):
        return None
    wildcards = {name for _, name, _, _ in Formatter().parse(pattern) if name}
    return wildcards, {keyword.arg for keyword in call.keywords}


def test_patterns_of_results_get_the_names_of_their_wildcards():
    # in benchmarks, too, of which nothing else runs
    calls = [
        node
        for path in [*SOURCES, *PROGRAMS]
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call)
    ]
    found = [pair for pair in map(wildcards_and_names, calls) if pair]
    assert len(found) > 5
    assert [pair for pair in found if pair[0] != pair[1]] == []


def test_no_vague_names():
    vague = re.compile(r"(utils?|helpers?|managers?|misc|pipelines?|\w*V\d)", re.I)
    found = []
    for path in [*SOURCES, *SCRIPTS, *RULE_FILES]:
        defined = re.findall(r"^ *(?:def|class) (\w+)", path.read_text(), re.MULTILINE)
        for name in [path.stem, *defined]:
            words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).split("_")
            found += [(short(path), name) for word in words if vague.fullmatch(word)]
    assert found == []


def locked() -> dict[str, str]:
    """Return the version of each package that is locked, all with hashes, and the same
    in both files."""
    versions: dict[str, str] = {}
    for name in ("requirements.txt", "requirements-dev.txt"):
        text = (ROOT / "envs" / name).read_text()
        found = dict(
            re.findall(
                r"^([\w.-]+)==([^ ]+).*?\\\n    --hash=sha256:",
                text,
                flags=re.MULTILINE,
            )
        )
        assert len(found) == len(re.findall(r"^\w", text, flags=re.MULTILINE))
        assert found == found | {
            package: versions[package] for package in found.keys() & versions
        }
        versions |= found
    return versions


def test_conda_environment_has_the_packages_of_the_project_as_they_are_locked():
    environment = yaml.safe_load((ROOT / "envs" / "gyriflow.yaml").read_text())
    (pip,) = [
        entry["pip"] for entry in environment["dependencies"] if isinstance(entry, dict)
    ]
    content, versions = tomllib.loads((ROOT / "pyproject.toml").read_text()), locked()
    project = content["project"]
    extras = [
        *project["optional-dependencies"]["fold"],
        *project["optional-dependencies"]["calibrate"],
    ]
    entries = [*project["dependencies"], *extras, *content["dependency-groups"]["dev"]]
    # conda-forge has dolfinx, which brings numpy
    from_conda = {"numpy", "dolfinx-solver-real"}
    names = [re.split(r"[<>=]", entry)[0] for entry in entries]
    needed = [name for name in names if name not in from_conda]
    assert pip == [f"{name}=={versions[name.lower()]}" for name in needed]


IMPORT_NAMES = {
    "dolfinx-solver-real": "dolfinx",
    "picsl-greedy": "picsl_greedy",
    "scikit-image": "skimage",
    "libigl": "igl",
    "connected-components-3d": "cc3d",
    "PyYAML": "yaml",
    "pillow": "PIL",
    "Jinja2": "jinja2",
    "MarkupSafe": "markupsafe",
}
"""Names by which packages are imported, where it is another."""
INDIRECT = {
    *("ufl", "basix", "ffcx", "mpi4py", "petsc4py", "dolfinx_solver", "cffi"),
    "pydantic_core",
    "snakemake_interface_logger_plugins",
    "vtkmodules",
}
"""Packages that come with the solver of the extra `fold`, pydantic, Snakemake and
pyvista."""


def import_names(requirements: list[str]) -> set[str]:
    """Return the names by which required packages are imported."""
    packages = [re.split(r"[<>=!;]", entry)[0] for entry in requirements]
    return {IMPORT_NAMES.get(package, package) for package in packages}


def test_extras_that_messages_name_are_those_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = {
        name: extra
        for extra, requirements in project["optional-dependencies"].items()
        for name in import_names(requirements)
    }
    assert extras == EXTRAS


def test_imported_packages_are_dependencies():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    listed = import_names(project["dependencies"]) | INDIRECT
    for requirements in project["optional-dependencies"].values():
        listed |= import_names(requirements)
    imported = set()
    for path in [*(ROOT / "src").rglob("*.py"), *SCRIPTS]:
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Import):
                imported |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                imported.add(str(node.module).split(".")[0])
    own = {path.name for path in (ROOT / "src").iterdir()}
    assert imported - sys.stdlib_module_names - own - listed == set()


def test_conda_environment_sets_what_run_sets():
    lines = (ROOT / "run").read_text().splitlines()
    settings = [line for line in lines if line.startswith("export") and ":-" in line]
    assigned = r"\b([A-Z]\w+)=(?:\$\{\w+:-)?([\w:,.=]+)\}?"
    pairs = re.findall(assigned, "\n".join(settings))
    exports = dict(pairs)
    environment = yaml.safe_load((ROOT / "envs" / "gyriflow.yaml").read_text())
    # what concerns the checkout and the user's Python is the launcher's own
    assert environment["variables"] == {
        name: exports[name] for name in exports if not name.startswith("PYTHON")
    }


def test_images_are_made_by_one_script_from_the_lists():
    for recipe in ("Dockerfile", "gyriflow.def"):
        image = (ROOT / "envs" / recipe).read_text()
        assert "/opt/gyriflow/envs/install_image.sh" in image
        assert "apt-get" not in image
        assert "pip" not in image
    text = (ROOT / "envs" / "install_image.sh").read_text()
    assert "$envs/debian.txt" in text
    assert "$envs/requirements.txt" in text
    own = re.findall(r"install (?:-\S+ )*([\w.=-]+)", text)
    assert set(own) <= {"-r", "--no-deps", "--no-install-recommends"}
    packages = {
        line.split("#")[0].strip()
        for line in (ROOT / "envs" / "debian.txt").read_text().splitlines()
    }
    assert packages & set(text.split()) == set()


def test_both_images_copy_the_same_files():
    lines = (ROOT / ".dockerignore").read_text().splitlines()
    copied = [line.removeprefix("!") for line in lines if line.startswith("!")]
    assert lines[0] == "*"
    definition = (ROOT / "envs" / "gyriflow.def").read_text()
    files = re.search(r"^%files\n((?:    .*\n)*)", definition, re.MULTILINE)[1]
    pairs = [line.split() for line in files.splitlines()]
    assert pairs == [[name, f"/opt/gyriflow/{name}"] for name in copied]


def test_libraries_that_jobs_need_are_in_the_list_that_is_installed():
    lines = (ROOT / "envs" / "debian.txt").read_text().splitlines()
    assert set(LIBRARIES.values()) <= {line.strip() for line in lines}


def test_images_use_the_python_of_the_conda_environment():
    assert "FROM python:3.13-slim\n" in (ROOT / "envs" / "Dockerfile").read_text()
    assert "From: python:3.13-slim\n" in (ROOT / "envs" / "gyriflow.def").read_text()
    assert (
        "python=3.13"
        in yaml.safe_load((ROOT / "envs" / "gyriflow.yaml").read_text())["dependencies"]
    )


def test_citation_has_the_version_of_the_package():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    zenodo = json.loads((ROOT / ".zenodo.json").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    fallback = project["tool"]["hatch"]["version"]["raw-options"]["fallback_version"]
    images = [
        (ROOT / "envs" / recipe).read_text()
        for recipe in ("Dockerfile", "gyriflow.def")
    ]
    labels = [
        *re.findall(r"ARG VERSION=(.*)", images[0]),
        *re.findall(r"(?:Version |install_image.sh )(\S+)", images[1]),
    ]
    assert len(labels) == 3
    assert {citation["version"], zenodo["version"], fallback, *labels} == {RELEASE}
    assert f"## {RELEASE}" in (ROOT / "CHANGELOG.md").read_text()


def test_links_in_the_documentation_lead_somewhere():
    folders = ROOT / "config", ROOT / "docs"
    pages = [
        *ROOT.glob("*.md"),
        *(page for folder in folders for page in folder.rglob("*.md")),
    ]
    broken = [
        f"{short(page)}: {target}"
        for page in pages
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text())
        if not target.startswith("http") and not (page.parent / target).exists()
    ]
    assert broken == []


def test_text_is_read_in_utf_8_whatever_the_locale():
    sources = [*(ROOT / "src").rglob("*.py"), *(ROOT / "workflow").rglob("*.py")]
    without = [
        source.name
        for source in sources
        if ".read_text()" in source.read_text(encoding="utf-8")
    ]
    assert without == []
