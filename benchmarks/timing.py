"""The clocks and statistics of `otwarp.bench`, by which all benchmarks measure."""

from otwarp.bench.timing import LONGEST_CALL, Elapsed, Pairs, Spread, calls_for, elapsed, interleaved

__all__ = ["LONGEST_CALL", "Elapsed", "Pairs", "Spread", "calls_for", "elapsed", "interleaved"]
