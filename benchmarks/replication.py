"""Print what a run of the paper's studies found beside what the paper reports, as a table in Markdown.

    ./run gyriflow run config/examples/paper.yaml -d paper --stage replication
    ./run python benchmarks/replication.py paper

Rows that cannot be compared (results of other authors, bands that are not resolved, sides of
a brain that is its own mirror image) and values of whole bands are left out; the page `results/study/replication.html`
has them.
"""

import argparse
from pathlib import Path

from gyriflow.compare.published import NO_BANDS, NOT_RUN, NOT_TESTED
from gyriflow.io.files import read_table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="working directory of the run")
    table = read_table(parser.parse_args().folder / "results" / "study" / "replication.csv")
    print("| result | the paper | here | verdict |\n| --- | --- | --- | --- |")
    is_compared = ~table["verdict"].isin([NOT_RUN, NOT_TESTED]) & (table["here"] != NO_BANDS)
    is_compared &= ~table["result"].str.contains("measured") & ~table["here"].str.startswith("hemispheres are mirror")
    for row in table[is_compared].itertuples():
        print(f"| {row.result} | {row.paper} | {row.here.split('; left, whole bands')[0]} | {row.verdict} |")


if __name__ == "__main__":
    main()
