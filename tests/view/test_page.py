"""The page of recordings, without a browser."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("viser")

from otwarp.view.page import about_html


def test_what_files_say_of_themselves_is_text_and_no_markup():
    run: Any = SimpleNamespace(title="<i>a</i>", about=(("scene", "<img src=x onerror=alert(1)> & more"),))
    for sources in ([run], [run, run]):
        shown = about_html(sources)
        assert "<img" not in shown and "<i>" not in shown and "&lt;img src=x onerror=alert(1)&gt; &amp; more" in shown
    assert about_html([run, run]).count("&lt;i&gt;a&lt;/i&gt;") == 2
