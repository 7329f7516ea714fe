"""The scripts of the workflow, run on files of a folder as Snakemake runs them."""

import runpy
from pathlib import Path
from types import SimpleNamespace

OUTPUTS: dict[str, Path] = {}
"""Files that scripts have written in the current test, by script and name."""
SCRIPTS = Path(__file__).parents[1] / "workflow" / "scripts"


class Named(dict):
    """Files or settings of a job, which Snakemake hands over by name, as attributes,
    and in turn."""

    __getattr__ = dict.__getitem__

    def __iter__(self):
        return iter(self.values())


def run_script(name, folder, inputs, outputs, params=(), **more):
    """Run a script on files of a folder by their names, or lists of them, and write its
    log there."""
    inputs, outputs = (
        Named(
            {
                key: (
                    [str(folder / f) for f in file]
                    if isinstance(file, list)
                    else file and str(folder / file)
                )
                for key, file in files.items()
            }
        )
        for files in (inputs, outputs)
    )
    job = SimpleNamespace(
        input=inputs,
        output=outputs,
        log=[str(folder / "log")],
        params=Named(params),
        **more,
    )
    runpy.run_path(str(SCRIPTS / name), init_globals={"snakemake": job})
    for key, file in outputs.items():
        paths = file if isinstance(file, list) else [file]
        for number, path in enumerate(paths):
            if path:
                OUTPUTS[f"{name} {key} {number}"] = Path(path)
