"""The base of all settings: unknown keys are errors, and every field carries its unit, bounds and description."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator


class Settings(BaseModel):
    """Settings that are validated whole and cannot change afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, validate_default=True)

    @field_validator("*", mode="before")
    @classmethod
    def _refuse_truth_values_as_numbers(cls, value: Any, info: ValidationInfo) -> Any:
        # YAML reads `on`, `yes` and the like as true, which would pass as 1.0
        if isinstance(value, bool) and cls.model_fields[str(info.field_name)].annotation is not bool:
            raise ValueError("Input should be a number or text, not true or false")
        return value


def setting(default: Any, unit: str, description: str, **bounds: Any) -> Any:
    """Returns a pydantic field with its unit; `default` is ... where the user has to give the value.

    `bounds` are those of pydantic: gt, ge, lt, le, min_length, max_length, pattern.
    """
    return Field(default, description=description, json_schema_extra={"unit": unit}, **bounds)
