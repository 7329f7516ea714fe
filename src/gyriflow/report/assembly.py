"""What stands where in the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import pandas as pd
from markupsafe import Markup

from .first_page import brains_table, runs_table, what_was_done
from .page import Shown, caption_html, sections, table_html


@dataclass(frozen=True, eq=False)
class Results:
    """What the report tells of a study besides its figures and tables.

    Attributes
    ----------
    brains, surfaces, quality : as for `brains_table`
    runs, validation, displacement : as for `runs_table`
    provenance : what `software` returns, and files (brain, what, sha256, and path where it may be shown)
    metrics : {setting: {"value", "unit", "description"}}
    warnings : columns subject, run, step, level, message
    configuration : text, without paths unless they may be shown
    """

    brains: Sequence[Mapping[str, Any]]
    surfaces: Mapping[str, Mapping[str, Any]]
    runs: pd.DataFrame
    provenance: Mapping[str, Any]
    metrics: Mapping[str, Mapping[str, Any]]
    configuration: str
    validation: pd.DataFrame | None = None
    displacement: pd.DataFrame | None = None
    quality: pd.DataFrame | None = None
    warnings: pd.DataFrame | None = None


def assemble(results: Results, shown: Sequence[Shown], view: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what the page's template names: the first page, the sections, and where all comes from."""
    first = next((item for item in shown if item.first), None)
    weeks = {"content": Markup(first.content), "caption": caption_html(first.caption)} if first else None
    starts = ", ".join(dict.fromkeys(results.runs["subject"]))
    provenance = results.provenance
    return {
        "title": f"Simulated cortical folding of {starts}",
        "done": what_was_done(results.brains, results.runs),
        "brains": table_html(brains_table(results.brains, results.surfaces, results.quality)),
        "runs": table_html(runs_table(results.runs, results.validation, results.displacement)),
        "warnings": "" if results.warnings is None or results.warnings.empty else table_html(results.warnings),
        "weeks": weeks,
        "has_view": bool(view["groups"]),
        "sections": sections([item for item in shown if not item.first]),
        "made": made(provenance),
        "metrics": table_html(metrics_settings(results.metrics)),
        "files": table_html(input_files(provenance["files"])),
        "versions": table_html(versions(provenance)),
        "configuration": results.configuration,
    }


def made(provenance: Mapping[str, Any]) -> str:
    """Returns when and by which code the results were made."""
    commit = provenance["commit"]
    of = "not from a checkout of the source, so without a commit"
    if commit:
        of = f"commit {commit.removesuffix('-dirty')}{', changed' if commit.endswith('-dirty') else ''}"
    time = datetime.fromisoformat(provenance["recorded"]).strftime("%Y-%m-%d %H:%M UTC")
    return f"Made {time} by gyriflow {provenance['gyriflow']}, {of}."


def versions(provenance: Mapping[str, Any]) -> pd.DataFrame:
    """Returns a row for each package that was there, gyriflow and Python first."""
    found = {"gyriflow": provenance["gyriflow"], "Python": provenance["python"]} | provenance["packages"]
    return pd.DataFrame([(name, number) for name, number in found.items() if number], columns=["package", "version"])


def metrics_settings(settings: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """Returns a row for each setting of the metrics, which are the same for simulated and measured brains."""
    rows = [
        {
            "setting": name.replace("_", " "),
            "value": "default" if own["value"] is None else str(own["value"]),
            "unit": own["unit"],
            "what it is": own["description"].replace("`", ""),
        }
        for name, own in settings.items()
    ]
    return pd.DataFrame(rows)


def input_files(files: Sequence[Mapping[str, str]]) -> pd.DataFrame:
    """Returns a row for each input file with its SHA-256, by which it is known without its name."""
    columns = {"brain": "brain", "what": "what", "sha256": "SHA-256", "path": "path"}
    table = pd.DataFrame(files).rename(columns=columns)
    return table[[name for name in columns.values() if name in table]]
