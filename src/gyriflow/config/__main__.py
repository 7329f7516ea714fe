"""`python -m gyriflow.config` writes config/README.md and config/schema.json anew."""

import json

from ..shipped import SHIPPED
from .documentation import documentation, schema

if __name__ == "__main__":
    texts = {"README.md": documentation(), "schema.json": json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"}
    for name, text in texts.items():
        (SHIPPED / "config" / name).write_text(text, encoding="utf-8")
        print(f"wrote {SHIPPED / 'config' / name}")
