"""Registration of one label volume to another: overlap, folding and time.

    ./run python benchmarks/registration.py FIRST_labels.nii.gz SECOND_labels.nii.gz [--scheme spina-bifida-atlas]

The last line is one JSON object with the measures of `growth.registration_quality`, `seconds` and `cpu_seconds`, and
`refused`: why a study would not go on with this registration, or nothing.
"""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

from gyriflow.errors import InputError
from gyriflow.growth.channels import channels
from gyriflow.growth.diffeomorphic import register
from gyriflow.growth.registration_quality import judge, require_good
from gyriflow.io.volumes import read_label_volume
from gyriflow.io.yaml_files import SCHEMES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=Path)
    parser.add_argument("second", type=Path)
    parser.add_argument("--scheme", choices=SCHEMES, default="spina-bifida-atlas")
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    scheme = SCHEMES[arguments.scheme]
    brains = []
    for path in (arguments.first, arguments.second):
        volume = read_label_volume(path)
        brains.append(channels(volume.labels, volume.affine, cerebrum=scheme.cerebrum, cortex=scheme.cortex))
    registered = register(*brains, threads=arguments.threads)
    quality = judge(*brains, registered.deformation)
    refused = ""
    try:
        require_good(quality, pair=f"{arguments.first.name} to {arguments.second.name}")
    except InputError as error:
        refused = str(error)
    times = {"seconds": registered.seconds, "cpu_seconds": registered.cpu_seconds}
    print(json.dumps(asdict(quality) | times | {"refused": refused}))


if __name__ == "__main__":
    main()
