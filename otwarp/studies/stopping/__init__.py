"""How many trials a point gets, and the intervals that decide it.

What comes in are counts of successes and trials, what goes out are trials that a point should have, and ends of
intervals; nothing here runs or stores a trial.

| file | what it holds |
|---|---|
| `rules` | `Stop` and what makes it: a number, until an interval is narrow, a budget; open it first |
| `contour`, `looks` | trials where a contour may be; intervals that hold at a few looks fixed beforehand |
| `search` | the largest value along an axis that still does; rules as study files write them |
| `intervals` | intervals of probabilities, rates, survival |
"""
