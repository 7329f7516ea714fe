# What all rules share: the validated configuration, names, and where results lie.
import re

from gyriflow.errors import GyriflowError
from gyriflow.launch import hold_lock, keeps_going, refused_brains
from gyriflow.parameters.terms import SIDES
from gyriflow.step import record_exit_code
from gyriflow.units import week_tag

ENVIRONMENT = "../../envs/gyriflow.yaml"

# scripts and programs find the package without its being installed, in conda environments of single rules too
shell.prefix(
    f'set -euo pipefail; export PYTHONPATH="{SOURCE}${{{{PYTHONPATH:+:$PYTHONPATH}}}}"; '
    if CHECKED_OUT
    else "set -euo pipefail; "
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
            keys = set(content) if isinstance(content, dict) else set()
            if keys & {"brains", "atlas", "participants"}:
                base = file.resolve().parent
        return load(config, base, keep_going=keeps_going())
    except GyriflowError as error:
        print(f"gyriflow: {error}", file=sys.stderr)
        record_exit_code(error.exit_code)
        sys.exit(error.exit_code)


WHOLE_CONFIG = validated_config()
# brains that an earlier pass of this call has refused, and why; without them it finishes the study
REFUSED = {
    brain: cause
    for brain, cause in refused_brains().items()
    if brain in [known.id for known in WHOLE_CONFIG.brains]
}
CONFIG = WHOLE_CONFIG.without(REFUSED)
if workflow.is_main_process:
    for row in WHOLE_CONFIG.left_out.values():
        print(f"gyriflow: left out: {row['cause']}", file=sys.stderr)
BRAINS = [brain.id for brain in CONFIG.brains]
# every run with each of the brains that it folds
FOLDED = CONFIG.folded
CALIBRATED = CONFIG.calibrate.runs if CONFIG.calibrate else {}

# held as long as this process lives: how `gyriflow.launch` tells a live run from one that was interrupted
if workflow.is_main_process and not workflow.dryrun:
    LOCK = hold_lock(Path.cwd())

# where results lie
BRAIN = "results/brains/{brain}"
RUN = "results/runs/{run}/{brain}"
STUDY = "results/study"
# the surfaces of a brain, measured or simulated, by what their names begin with
SURFACES = {"whole": "pial", "left": "left.pial", "right": "right.pial"}


def surfaces_in(folder, sides=SIDES):
    """Returns the surface files of a brain in a folder, by part: the whole and the hemispheres that it has."""
    return {part: f"{folder}/{SURFACES[part]}.surf.gii" for part in ("whole", *sides)}


def sides_of(brain):
    """Returns the hemispheres that a brain has."""
    return CONFIG.brain(brain).sides


def with_sides(*sides):
    """Returns the ids of the brains that have these hemispheres and no other."""
    return [brain for brain in BRAINS if sides_of(brain) == sides]


def one_of(names):
    """Returns a pattern that matches exactly these names, or nothing if there are none."""
    return "|".join(map(re.escape, names)) or r"(?!)"


def from_source(*sources):
    """Returns a pattern of the brains that come from one of some sources, such as `labels`."""
    return one_of(brain.id for brain in CONFIG.brains if brain.source in sources)


def regional(run):
    """Returns whether a run's growth differs between regions or directions as measured by registration."""
    follow = CONFIG.run(run).follow
    return follow is not None and (follow.regional > 0 or follow.directional > 0)


def of_runs(pattern, **wildcards):
    """Returns the files of a pattern for every run and each brain that it folds."""
    return [
        file
        for run, brain in FOLDED
        for file in expand(pattern, run=run, brain=brain, **wildcards)
    ]


def week_tags(run, brain):
    """Returns the output weeks of a run from a brain as they stand in file names."""
    return [week_tag(week) for week in CONFIG.weeks(run, brain)]


def of_weeks(pattern):
    """Returns the files of a pattern for every run, brain and output week."""
    return [
        file
        for run, brain in FOLDED
        for file in expand(pattern, run=run, brain=brain, week=week_tags(run, brain))
    ]


def comparable(brain):
    """Returns the brains that a start brain may be compared with.

    They have the same hemispheres, and are of its population where it has one.
    """
    population = CONFIG.brain(brain).population
    return [
        other
        for other in CONFIG.brains
        if population in (None, other.population) and other.sides == sides_of(brain)
    ]


def measured_after_start(run, brain):
    """Returns, by output week after the start, the ids of the measured brains that a run is compared with.

    Later scans of the start's own subject come first.
    """
    subject = CONFIG.brain(brain).subject
    ordered = sorted(
        comparable(brain),
        key=lambda other: subject is None or other.subject != subject,
    )
    found = {
        week: [other.id for other in ordered if week_tag(other.week) == week]
        for week in week_tags(run, brain)[1:]
    }
    return {week: brains for week, brains in found.items() if brains}


def comparisons():
    """Returns (run, brain, week, measured brain) for every output week after the start with measured brains."""
    return [
        (run, brain, week, measured)
        for run, brain in FOLDED
        for week, brains in measured_after_start(run, brain).items()
        for measured in brains
    ]


def figure(path, title, caption, category, **labels):
    """Returns the outputs of a rule that draws a figure: PNG, marked for the report, and PDF."""
    labels = {"figure": title, **labels}
    return {
        "png": report(
            f"{path}.png",
            caption=f"../report/{caption}",
            category=category,
            labels=labels,
        ),
        "pdf": f"{path}.pdf",
    }


def drawing(*brains):
    """Returns the parameters of all figures: their resolution, and whether they show synthetic brains only."""
    if brains:
        synthetic = all(CONFIG.brain(brain).synthetic for brain in brains)
    else:
        synthetic = lambda wildcards: CONFIG.brain(wildcards.brain).synthetic
    return {"synthetic": synthetic, "dpi": CONFIG.report.dpi}


wildcard_constraints:
    brain=one_of(BRAINS),
    run=one_of([*CONFIG.runs, *CONFIG.study_runs, *CALIBRATED]),
    week=r"\d+\.\d+",
    side="|".join(SIDES),
