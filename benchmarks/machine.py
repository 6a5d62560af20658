"""The description of a machine of `otwarp.bench`, which stands above all tables."""

from otwarp.bench.machine import Machine

__all__ = ["Machine"]
