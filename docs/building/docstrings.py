"""How docstrings of this project are read: `low, high: …` describes two parameters, `Example:` shows code."""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension

SEVERAL = re.compile(r"^( +)(\w+(?:, \*{0,2}\w+)+): ((?:.*\n?)(?:\1 +.*\n?)*)", re.MULTILINE)


def several(match: re.Match[str]) -> str:
    """An entry for each of the parameters that one entry describes."""
    indent, names, text = match.groups()
    entries = [f"{indent}{name}: {text.rstrip()}" for name in names.split(", ")]
    return "\n".join(entries) + ("\n" if text.endswith("\n") else "")


def as_google(text: str) -> str:
    """A docstring in the form that Griffe reads."""
    head, args, rest = text.partition("\nArgs:\n")
    end = re.search(r"^\S", rest, re.MULTILINE)
    at = end.start() if end else len(rest)
    text = head + args + SEVERAL.sub(several, rest[:at]) + rest[at:]
    return re.sub(r"^Example:$", "Examples:", text, flags=re.MULTILINE)


class Docstrings(Extension):
    """Griffe's extension that reads them so."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        """Rewrite the docstring of one object before it is parsed."""
        if obj.docstring:
            obj.docstring.value = as_google(obj.docstring.value)
