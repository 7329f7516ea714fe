"""Have Snakemake run jobs again after a change of code or of contents, by internals of it that nothing else uses."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from ..code_hash import code_hash

REMOVED = (".csv", ".html", ".png", ".pdf")


def rerun_on_changes(rules: Iterable[Any], contents: Mapping[str, str], scripts: Path) -> None:
    """Give rules parameters that change with the code of their script and with what their inputs hold.

    Snakemake reruns a job whose parameters have changed. It sees no change of a package that a script imports, and none
    of an input that is replaced by an older file. A rule without a script has to name its code itself.

    Parameters
    ----------
    rules : all rules of a workflow, as `workflow.rules` has them
    contents : hashes of input files by path
    scripts : folder of the scripts
    """
    for rule in rules:
        if rule.script or rule.shellcmd:
            rule.set_params(contents=_contents_of(rule, contents))
        if rule.script and not hasattr(rule.params, "code"):
            rule.set_params(code=code_hash(scripts / Path(rule.script).name))


def complete_rules(rules: Iterable[Any], environment: str) -> None:
    """Give rules that name no environment the common one, and a benchmark file named like their log.

    For Snakemake's software deployment with conda, `environment` is the path of the environment's file.
    """
    for rule in rules:
        if (rule.script or rule.shellcmd) and not rule.conda_env:
            rule.conda_env, rule.benchmark_modifier = environment, rule.log_modifier
            rule.benchmark = rule.log[0].replace("/logs/", "/benchmarks/").removesuffix(".log") + ".tsv"


def _contents_of(rule: Any, contents: Mapping[str, str]) -> Any:
    def read_by_job(wildcards: Any) -> list[str]:
        inputs = rule.expand_input(wildcards)[0]
        return [f"input with the content {contents[path]}" for path in inputs if path in contents]

    return read_by_job


def remove_stale(rules: Collection[Any], *folders: str) -> None:
    """Remove the tables, figures and pages in folders that no rule makes, such as those of refused brains."""
    for path in (path for folder in folders for path in Path(folder).rglob("*") if path.suffix in REMOVED):
        if not any(rule.is_producer(str(path)) for rule in rules):
            path.unlink()


def benchmark_patterns(rules: Iterable[Any]) -> dict[str, str]:
    """Return the regular expression of the benchmark files of each rule that has any, with wildcards as groups."""
    return {rule.name: rule.benchmark.regex().pattern for rule in rules if rule.benchmark}
