"""What pyproject.toml cannot say: a wheel takes shipped scenes, studies and data sets from the root of the checkout.

They are not links in the package, because links break in archives and on systems without them.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
SHIPPED = {"scenes": "*.usda", "studies": "*.toml", "vision": "*.toml"}
"""As `ENDINGS` of `otwarp/shipped/__init__.py` says."""


class WithShipped(build_py):
    """Builds the package, and copies shipped files into it unless it is installed as a link to the checkout."""

    def _shipped(self) -> dict[Path, Path]:
        """Files in the checkout, by their places in the build."""
        build = Path(self.build_lib) / "otwarp" / "shipped"
        return {build / kind / f.name: f for kind, some in SHIPPED.items() for f in sorted((ROOT / kind).glob(some))}

    def run(self) -> None:
        """Build."""
        super().run()
        if not self.editable_mode:
            for place, file in self._shipped().items():
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, place)

    def get_outputs(self, include_bytecode: bool = True) -> list[str]:
        """All that is built."""
        copied = [] if self.editable_mode else [str(place) for place in self._shipped()]
        return [*super().get_outputs(include_bytecode), *copied]

    def get_source_files(self) -> list[str]:
        """All that a source archive needs."""
        return [*super().get_source_files(), *(str(f.relative_to(ROOT)) for f in self._shipped().values())]


setup(cmdclass={"build_py": WithShipped})
