"""User files are untrusted: no code comes from them, in the sources of the package, the
workflow and the launcher."""

import ast
import re
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
SOURCES = sorted(
    [*(CHECKOUT / "src").rglob("*.py"), *(CHECKOUT / "workflow").rglob("*.py")]
)
RULES = sorted(
    [*(CHECKOUT / "workflow" / "rules").glob("*.smk"), CHECKOUT / "Snakefile"]
)

UNPICKLING = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
CALLS = {
    "eval",
    "exec",
    "compile",
    "__import__",
    "os.system",
    "os.popen",
    "tempfile.mktemp",
    "tarfile.open",
    "pd.read_pickle",
    "pandas.read_pickle",
    "pv.read_pickle",
    "yaml.full_load",
    "yaml.unsafe_load",
    "yaml.load_all",
    "shutil.unpack_archive",
    "zipfile.ZipFile",
}
TRUE_IS_BAD = {"shell", "allow_pickle"}
SAFE_LOADERS = {"SafeLoader", "CSafeLoader", "_StrictLoader"}


def dangers(source):
    """Return what a source has that makes code of data, or files that others may
    read."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = (
                [node.module or ""]
                if isinstance(node, ast.ImportFrom)
                else [name.name for name in node.names]
            )
            names = {name.name for name in node.names}
            unpickles = names != {"cpu_count"}
            found += [
                module
                for module in modules
                if module.split(".")[0] in UNPICKLING and unpickles
            ]
        elif isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            given = {
                keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords
            }
            unsafe = (
                called == "yaml.load"
                and given.get("Loader", "").split(".")[-1] not in SAFE_LOADERS
            )
            found += [called] if unsafe or called in CALLS else []
            found += [
                name
                for name in TRUE_IS_BAD & set(given)
                if given[name] not in ("False", "None")
            ]
    return found


def test_no_source_makes_code_of_data():
    assert len(SOURCES) > 150
    assert {
        str(path.relative_to(CHECKOUT)): found
        for path in SOURCES
        if (found := dangers(path.read_text()))
    } == {}


DANGEROUS = """
import pickle
from pickle import loads
eval(text)
yaml.load(text, Loader=yaml.Loader)
yaml.load(text, yaml.SafeLoader)
subprocess.run(text, shell=True)
subprocess.run(text, shell=wanted)
np.load(path, allow_pickle=True)
os.system(text)
tempfile.mktemp()
"""


def test_dangers_are_seen_and_what_only_looks_like_one_is_not():
    assert [line for line in DANGEROUS.strip().splitlines() if not dangers(line)] == []
    assert (
        dangers(
            "model.eval()\nre.compile(x)\nnp.load(p, allow_pickle=False)\npickles = 1"
        )
        == []
    )


def test_shell_commands_of_rules_quote_what_they_are_given():
    """Values in the text of a shell command are quoted (`:q`), but for numbers and the
    MPI launcher of a profile."""
    places = []
    for path in RULES:
        text = path.read_text()
        for block in re.findall(
            r"^SOLVE = \((.*?)^\)|^    shell:\n((?:        [^\n]*\n)*)",
            text,
            re.DOTALL | re.MULTILINE,
        ):
            texts = re.findall(r'"(.*)"', "".join(block))
            places += [
                place
                for text in texts
                for place in re.findall(r"(?<!\{)\{(?!\{)([^{}]+)\}", text)
            ]
    assert len(places) > 5
    assert {place for place in places if not place.endswith(":q")} == {
        "resources.mpi",
        "resources.tasks",
    }
