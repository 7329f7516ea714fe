"""The figures that the rules plan for a configuration, with their inputs and
parameters."""

from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import yaml
from snakemake.api import SnakemakeApi
from snakemake.iocontainers import Wildcards
from snakemake.settings.types import (
    ConfigSettings,
    DAGSettings,
    DeploymentSettings,
    OutputSettings,
    Quietness,
    ResourceSettings,
    StorageSettings,
    WorkflowSettings,
)
from snakemake_interface_executor_plugins.settings import ExecMode

from gyriflow.running import launch

SNAKEFILE = Path(__file__).parents[1] / "Snakefile"


@dataclass(frozen=True)
class PlannedFigure:
    """A figure of a study: the rule that draws it, the values of its wildcards, its
    files, and the inputs and parameters of the rule."""

    name: str
    rule: str
    values: dict
    files: list
    inputs: dict
    params: dict


def planned_figures(folder, config, ended=(), mode=ExecMode.DEFAULT):
    """Return the figures that are planned in a folder, and the globals of the rules.

    Runs that `ended` have not reached the week of their sweep. `mode` is that of
    Snakemake: by default of the process that runs a study.
    """
    path = folder / "study.yaml"
    path.write_text(yaml.safe_dump(config, sort_keys=False))
    # planned as in a dry run, which leaves no records
    with (
        chdir(folder),
        patch.object(launch, "session", launch.Session(is_launched=True, is_dry=True)),
        SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api,
    ):
        workflow = api.workflow(
            resource_settings=ResourceSettings(cores=1),
            config_settings=ConfigSettings(configfiles=[path]),
            storage_settings=StorageSettings(),
            workflow_settings=WorkflowSettings(exec_mode=mode),
            deployment_settings=DeploymentSettings(),
            snakefile=SNAKEFILE,
            workdir=folder,
        )
        workflow.dag(DAGSettings())
        rules = list(workflow._workflow.rules)
        names = workflow._workflow.globals
        names["reaches"] = lambda run, brain, week: run not in ended
        return list(_planned(rules, names["FIGURES"])), names


def _planned(rules, figures):
    for name, figure in figures.items():
        for values in figure["names"]:
            files = [str(file).format(**values) for file in figure["files"]]
            (rule,) = [rule for rule in rules if rule.is_producer(files[0])]
            wildcards = rule.get_wildcards(files[0])
            inputs, *_ = rule.expand_input(wildcards)
            outputs, _ = rule.expand_output(wildcards)
            params, *_ = rule.expand_params(
                Wildcards(fromdict=wildcards), inputs, outputs, None
            )
            yield PlannedFigure(
                name,
                rule.name,
                values,
                files,
                dict(inputs.items()),
                dict(params.items()),
            )
