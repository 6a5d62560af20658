"""`python -m otwarp.scene.schema`: rewrite the generated files."""

from __future__ import annotations

from otwarp.scene.schema.generate import main

main()
