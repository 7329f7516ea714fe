"""`python -m gyriflow.settings > config/schema.json` writes the JSON schema of all
keys, for editors."""

import json

from .root import Config

if __name__ == "__main__":
    print(
        json.dumps(
            Config.model_json_schema(),
            indent=1,
            ensure_ascii=False,
        )
    )
