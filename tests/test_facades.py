"""What the packages offer to users by name: everything that they list is there, typed and loaded when used."""

import ast
import importlib
from pathlib import Path

import pytest

PACKAGES = ("otwarp", "otwarp.hydrodynamics", "otwarp.optics")


@pytest.mark.parametrize("package", PACKAGES)
def test_names_are_what_type_checkers_see(package):
    module = importlib.import_module(package)
    tree = ast.parse(Path(module.__file__).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {a.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for a in node.names}
    assert sorted(seen) == dir(module)
    for name, home in seen.items():
        # a file of the same name would take the name's place once it is imported
        assert getattr(module, name) is getattr(importlib.import_module(home), name), name


@pytest.mark.parametrize("package", PACKAGES)
def test_a_name_that_is_not_there_is_an_attribute_error(package):
    with pytest.raises(AttributeError, match=rf"'{package}' has no attribute 'nothing'"):
        _ = importlib.import_module(package).nothing
