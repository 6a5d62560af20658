"""What the site makes of links out of docs/, of docstrings, and of folders in its navigation."""

from __future__ import annotations

import pytest

pytest.importorskip("griffe")

from docs.building import links
from docs.building.docstrings import as_google


def test_links_lead_to_pages_of_the_site():
    page = links.DOCS / "validation" / "hertz.md"
    text = "[a](../dynamics.md#contact) [b](../../README.md) [c](../../otwarp/units.py#L3) `[d](../../LICENSE)` [e](https://x.y)"
    said = (
        "[a](../dynamics.md#contact) [b](../repository/README.md) [c](../repository/otwarp/units.py.md#L3) "
        "`[d](../../LICENSE)` [e](https://x.y)"
    )
    assert links.relink(text, page) == said
    assert [path.name for path in links.targets(text, page)] == ["dynamics.md", "README.md", "units.py"]


def test_pages_of_readme_and_of_sources_link_on():
    assert "](../architecture.md)" in links.page_of(links.ROOT / "CONTRIBUTING.md")
    assert "](../docs/" not in links.page_of(links.ROOT / "README.md")
    source = links.page_of(links.ROOT / "otwarp" / "units.py")
    assert "# otwarp/units.py" in source and "````python" in source and "exclude: true" in source
    assert "[units.py](units.py.md)" in links.page_of(links.ROOT / "otwarp")
    assert links.uri_of(links.ROOT / "otwarp") == "repository/otwarp/contents.md"


def test_an_entry_of_several_parameters_is_one_for_each():
    end = "    n: How many.\n\nReturns:\n    a, b: of both\n\nExample"
    text = f"Say.\n\nArgs:\n    low, high: The ends\n        of it [µm].\n{end}:\n    >>> f(1)"
    assert as_google(text) == (
        "Say.\n\nArgs:\n    low: The ends\n        of it [µm].\n    high: The ends\n        of it [µm].\n"
        f"{end}s:\n    >>> f(1)"
    )
