"""Parts of Snakemake that gyriflow uses outside its public interface, tried with
Snakemake 9.27.0 and 9.27.1."""

import hashlib
import re
import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

from ..code_hash import code_hash
from ..errors import InputError
from ..io.files import contents
from ..io.origins import joined_contents
from ..settings.base import did_you_mean
from ..study.paths import log_of
from .manifest import recorded_results

UNKNOWN_EXECUTOR = re.compile(r"--executor.*invalid choice: '([\w-]+)'")
REMOVED = (".csv", ".html", ".png", ".pdf")


def shorten_usage_errors() -> None:
    """Have Snakemake end with one line if its options or profiles are wrong, without
    its whole usage, and say which package an executor needs."""
    from snakemake.common.argparse import ArgumentParser

    ArgumentParser.error = _end_with_one_line


def _end_with_one_line(_: Any, message: str) -> None:
    text = f"{message}. See `./run snakemake --help`."
    if executor := UNKNOWN_EXECUTOR.search(message):
        package = f"snakemake-executor-plugin-{executor[1]}"
        text = (
            f"the executor {executor[1]} needs the package {package}, which this"
            " environment has not. Install it as in docs/how-to/cluster.md"
        )
    print(f"gyriflow: {text}", file=sys.stderr)
    sys.exit(InputError.exit_code)


def max_jobs(arguments: Sequence[str]) -> int | None:
    """Return how many jobs run at the same time by a call's options and profiles; None
    if they do not say."""
    from snakemake import cli

    options, _ = cli.get_argument_parser().parse_known_args(arguments)
    if options.profile:
        parser = cli.get_argument_parser(profiles=options.profile)
        options, _ = parser.parse_known_args(arguments)
    return options.jobs


def rerun_on_code_changes(rules: Iterable[Any], scripts: Path) -> None:
    """Give rules a parameter that changes with their code; jobs whose parameters have
    changed run again.

    Snakemake itself sees the date of a script, which a new checkout changes, and no
    package that a script imports. A shell command has to name the code of its program
    itself. `scripts` is the folder of the rules' scripts.
    """
    for rule in rules:
        script = scripts / Path(rule.script or "").name
        if rule.script and not hasattr(rule.params, "code"):
            rule.set_params(code=code_hash(script))
        if rule.script or rule.shellcmd:
            text = rule.shellcmd or script.read_text(encoding="utf-8")
            rule.set_params(
                command=f"code {hashlib.sha256(text.encode()).hexdigest()[:12]}"
            )


def complete_rules(rules: Iterable[Any], environment: str) -> None:
    """Give rules a log (see `log_of`), and rules that name no environment the common
    one.

    For Snakemake's software deployment with conda, `environment` is the path of the
    environment's file.
    """
    from snakemake.io import strip_wildcard_constraints

    for rule in rules:
        # a rule without output has nothing to do in this study
        runs = rule.output and (rule.script or rule.shellcmd)
        if runs and not rule.log:
            rule.log_modifier = rule.output_modifier
            rule.set_log(
                log_of(
                    rule.name,
                    strip_wildcard_constraints(rule.output[0]),
                )
            )
        if runs and not rule.conda_env:
            rule.conda_env = environment


def remove_stale(rules: Collection[Any], *folders: str) -> None:
    """Remove tables, figures and pages that an earlier run made and no rule makes, such
    as those of refused brains.

    Files that a user has saved or changed in these `folders` are left.
    """
    recorded = recorded_results(Path("results"))
    present = joined_contents(contents(recorded, recorded))
    for name, (content, *_) in recorded.items():
        path = Path(name)
        is_in_folders = any(path.is_relative_to(folder) for folder in folders)
        is_result = is_in_folders and path.suffix in REMOVED
        is_unchanged = present.get(name) == content
        if is_result and is_unchanged and not _is_made(name, rules):
            path.unlink()


def check_brains(
    targets: Iterable[str],
    rules: Iterable[Any],
    brains: Collection[str],
) -> None:
    """Raise InputError if a file that a call asks for is of none of the `brains`."""
    for target in targets:
        for rule in rules:
            if not rule.is_producer(target):
                continue
            brain = rule.get_wildcards(target).get("brain")
            if brain is not None and brain not in brains:
                raise InputError(
                    f"no stage or result is named {target}; the study has no brain"
                    f" {brain}; {did_you_mean(brain, brains)}"
                )


def _is_made(path: str, rules: Collection[Any]) -> bool:
    return any(rule.is_producer(path) for rule in rules)
