"""JSON schemas as Foxglove reads them: an object whose fields are plain types, arrays of one type, or objects again."""

from typing import Any

import msgspec

from rolling_panda import messages as m

_PLAIN = {"boolean": "boolean", "integer": "integer", "number": "number", "string": "string"}


def schema_of(kind: type[m.Message]) -> dict[str, Any]:
    """The schema of a message: bounds, patterns, references and "or nothing" left out, since viewers know none."""
    (reference,), definitions = msgspec.json.schema_components((kind,), ref_template="{name}")
    return {"title": kind.__name__, **_simple(reference, definitions)}


def _simple(schema: dict[str, Any], definitions: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in schema:
        return _simple(definitions[schema["$ref"]], definitions)
    if "anyOf" in schema:
        some = [choice for choice in schema["anyOf"] if choice.get("type") != "null"]
        return _simple(some[0], definitions)
    if schema.get("type") == "object":
        fields = schema.get("properties", {})
        return {"type": "object", "properties": {name: _simple(field, definitions) for name, field in fields.items()}}
    if schema.get("type") == "array":
        items = schema.get("items") or schema.get("prefixItems", [{"type": "number"}])[0]
        return {"type": "array", "items": _simple(items, definitions)}
    if schema.get("contentEncoding") == "base64":
        return {"type": "string", "contentEncoding": "base64"}
    return {"type": _PLAIN.get(str(schema.get("type")), "string")}
