# What all rules share: the validated configuration, names, and the hash of the code behind a rule.
import hashlib
import re

from gyriflow.errors import GyriflowError
from gyriflow.launch import hold_lock
from gyriflow.step import record_exit_code
from gyriflow.units import week_tag

ENVIRONMENT = "../../envs/gyriflow.yaml"

# scripts and programs find the package without its being installed, in conda environments of single rules too
shell.prefix(
    f'set -euo pipefail; export PYTHONPATH="{SOURCE}${{{{PYTHONPATH:+:$PYTHONPATH}}}}"; '
)


def validated_config():
    """Returns the configuration as models; ends with a message and exit code 2 where it is not valid."""
    from gyriflow.config import load
    from gyriflow.io.yaml_files import read_yaml

    try:
        base = Path.cwd()
        for path in workflow.configfiles:
            # Snakemake's own reading keeps the last of two equal keys
            file = Path(workflow.workdir_init, path)
            content = read_yaml(file)
            if isinstance(content, dict) and {"brains", "atlas"} & set(content):
                base = file.resolve().parent
        return load(config, base)
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        record_exit_code(error.exit_code)
        sys.exit(error.exit_code)


CONFIG = validated_config()
START = CONFIG.start
BRAINS = [brain.id for brain in CONFIG.brains]
RUNS = list(CONFIG.runs)
SYNTHETIC = CONFIG.brain(START).synthetic

# held as long as this process lives: how `gyriflow.launch` tells a live run from one that was interrupted
if workflow.is_main_process and not workflow.dryrun:
    LOCK = hold_lock(Path.cwd())


def one_of(names):
    """Returns a pattern that matches exactly the names; with none, nothing."""
    return "|".join(map(re.escape, names)) or r"(?!)"


def code(*rooms):
    """Returns a hash of the source of rooms of the package, so that a change of the code reruns the rules it serves."""
    total = hashlib.sha256()
    for room in sorted({*rooms, "geometry", "io"}):
        for path in sorted(Path(SOURCE, "gyriflow", room).rglob("*.py")):
            total.update(path.read_bytes())
    return total.hexdigest()[:12]


def week_tags(run):
    """Returns the output weeks of a run as they stand in file names."""
    return [week_tag(week) for week in CONFIG.weeks(run)]


def comparisons():
    """Returns (run, week, brain) for every output week after the start for which there is a measured brain."""
    return [
        (run, week_tag(week), brain.id)
        for run in RUNS
        for week in CONFIG.weeks(run)[1:]
        for brain in CONFIG.brains
        if abs(brain.week - week) < 1e-6
    ]


wildcard_constraints:
    brain=one_of(BRAINS),
    run=one_of(RUNS),
    week=r"\d+\.\d+",
