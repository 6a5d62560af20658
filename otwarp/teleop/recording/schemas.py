"""What the JSON in a recording looks like: a JSON Schema (draft 2020-12) for every topic whose messages are JSON texts.

The recording holds them itself, as its `/otwarp/schemas`.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from otwarp.haptics.recording import CONFIG
from otwarp.teleop.core import PaceNow

SCHEMAS = "/otwarp/schemas"
COMMANDS, PACE, END, START = "/otwarp/commands", "/otwarp/pace", "/otwarp/end", "/otwarp/start/"
"""`START` is followed by the name of the hand."""

DRAFT = "https://json-schema.org/draft/2020-12/schema"
_TEXT, _NUMBER, _COUNT = {"type": "string"}, {"type": "number"}, {"type": "integer", "minimum": 0}
_VECTOR = {"type": "array", "items": _NUMBER, "minItems": 3, "maxItems": 3}
_GAIN = {"type": ["number", "null"]}


def _object(about: str, required: dict[str, Any], **more: Any) -> dict[str, Any]:
    """An object that has all of `required`."""
    return {"type": "object", "description": about, "properties": required, "required": list(required), **more}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_CURVE = _object(
    "eq. 1 at 1 mW: K [pN/um], δ [um], A [pN um^2], C [pN], D [um]",
    {name: _NUMBER for name in ("stiffness", "threshold", "inverse_square", "constant", "cutoff")},
)
_GRID = _object(
    "nodes are float32, little-endian, base64",
    {"spacing": _NUMBER, "radius": _NUMBER, "end": _NUMBER, "columns": _COUNT, "node": _TEXT},
)
_LAW = {
    "oneOf": [
        _object(
            "one curve", {"kind": {"const": "isotropic"}, "curve": _CURVE, "axis": _VECTOR, "equilibrium": _NUMBER}
        ),
        _object(
            "across and along the beam",
            {
                "kind": {"const": "split"},
                "radial": _CURVE,
                "axial": _CURVE,
                "axis": _VECTOR,
                "equilibrium": _NUMBER,
            },
        ),
        _object(
            "a force table",
            {
                "kind": {"const": "table"},
                "grids": _list(_GRID),
                "layers": {"enum": [1, 2, 3]},
                "cubic": {"type": "boolean"},
                "scale": _NUMBER,
                "side": _VECTOR,
                "axis": _VECTOR,
            },
        ),
    ]
}
_PACE = {
    "beat": _COUNT,
    "wall": _NUMBER,
    "step": _COUNT,
    "simulated": _NUMBER,
    **{field.name: {"type": ["number", "boolean"]} for field in dataclasses.fields(PaceNow)},
}

JSON: dict[str, dict[str, Any]] = {
    CONFIG: _object(
        "how the session was set up: all that a replay needs beside samples and states",
        {
            "format": _COUNT,
            "otwarp": _TEXT,
            "recorded": _TEXT,
            "units": _TEXT,
            "haptics": _object("fields of HapticsConfig", {"hands": _list({"type": "object"})}),
            "devices": {"type": "object", "additionalProperties": _TEXT},
            "laws": _list(_LAW),
            "traps": {"type": "object", "additionalProperties": _list(_COUNT)},
            "kinds": _list(_COUNT),
            "settings": {"type": "object"},
            "clock": _object("t [s] of the loop is epoch + (t - began) ns", {"began": _NUMBER, "epoch": _COUNT}),
            "scene": _object(
                "what was simulated",
                {"file": {"type": ["string", "null"]}, "digest": _TEXT, "bodies": _list(_TEXT), "traps": _list(_TEXT)},
            ),
        },
    ),
    COMMANDS: _object("what was carried out, with its own fields", {"time": _NUMBER, "command": _TEXT}),
    PACE: _object("how simulated time followed the clock [s]", _PACE, additionalProperties=False),
    START: _object(
        "what the chain of a hand remembered before its first recorded cycle",
        {
            "tick": _COUNT,
            "chain": {
                "oneOf": [
                    {"type": "null"},
                    _object(
                        "a Rendering",
                        {
                            "gains": {"type": "array", "items": _GAIN, "minItems": 2, "maxItems": 2},
                            "device": {"type": ["object", "null"]},
                            "chain": {"type": ["object", "null"]},
                        },
                    ),
                ]
            },
        },
    ),
    END: _object("what is missing", {"dropped": _COUNT, "lost": {"type": "object", "additionalProperties": _COUNT}}),
}
"""Topic → schema of its messages; that of `START` is for every hand."""


def schema_of(topic: str) -> dict[str, Any] | None:
    """Schema of a topic's messages, None if they are not JSON."""
    return JSON[START] if topic.startswith(START) else JSON.get(topic)


def schemas() -> dict[str, Any]:
    """For a recording: topic → schema; one that ends in `/` is for all that begin so."""
    return {topic: {"$schema": DRAFT, "title": topic, **schema} for topic, schema in JSON.items()}
