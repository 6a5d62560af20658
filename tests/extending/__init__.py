"""Tests of what each walk of docs/extending.md leads to; they run in the copy of the package that took the walk."""
