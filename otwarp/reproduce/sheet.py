"""Looks of the report: one style sheet, no script, nothing from elsewhere."""

from __future__ import annotations

SHEET = """
:root { --ink: #1d2b42; --soft: #5b6880; --line: #dfe4ec; --pale: #f5f7fa; --ours: #0067a3; --theirs: #b44a00;
  --wash-ours: #eaf4fb; --wash-theirs: #fdf1e8; }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; }
body { margin: 0; color: var(--ink); background: #fff; display: grid; grid-template-columns: 15.5rem minmax(0, 1fr);
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", Helvetica, Arial, "Liberation Sans", sans-serif; }
nav { position: sticky; top: 0; align-self: start; height: 100vh; overflow: auto; padding: 2rem 1.25rem;
  border-right: 1px solid var(--line); background: var(--pale); }
nav .brand { margin: 0 0 1.25rem; font-weight: 700; }
nav .brand span { font-weight: 400; color: var(--soft); }
nav ol { margin: 0; padding: 0; list-style: none; counter-reset: item; }
nav li { counter-increment: item; margin: .1rem 0; }
nav a { display: block; padding: .28rem .4rem .28rem 1.9rem; border-radius: 6px; color: inherit; text-decoration: none;
  text-indent: -1.5rem; font-size: .88rem; line-height: 1.35; }
nav a::before { content: counter(item); display: inline-block; width: 1.5rem; text-indent: 0; color: var(--soft);
  font-variant-numeric: tabular-nums; }
nav a:hover, nav a:focus-visible { background: #e8edf4; }
nav a.absent { color: var(--soft); }
main { padding: 2.5rem 3rem 4rem; max-width: 74rem; }
main a { color: inherit; text-decoration-color: #9aa6b8; text-underline-offset: .18em; }
#summary table.pair tbody td:first-child { width: 17%; }
#summary table.pair tbody th { width: 20%; overflow-wrap: anywhere; }
#summary table.pair td.theirs { width: 16%; } #summary table.pair td.ours { width: 20%; }
h1 { font-size: 2rem; line-height: 1.15; margin: 0 0 .6rem; letter-spacing: -.015em; }
h2 { font-size: 1.35rem; line-height: 1.2; margin: 0 0 .15rem; letter-spacing: -.01em; }
h3 { font-size: .95rem; margin: 1.6rem 0 .35rem; }
p { margin: .4rem 0; }
code { font: .88em ui-monospace, "SF Mono", Menlo, Consolas, "Liberation Mono", monospace; background: var(--pale);
  padding: .05em .3em; border-radius: 4px; }
.lede { max-width: 46rem; }
.kind { display: inline-block; margin: .8rem 0; padding: .45rem .8rem; border-radius: 8px; background: var(--wash-ours);
  font-size: .92rem; }
.kind.quick { background: #fff8dc; }
.grades { display: grid; grid-template-columns: repeat(2, auto 1fr); gap: .2rem .6rem; margin: .6rem 0 0;
  font-size: .85rem; color: var(--soft); max-width: 46rem; }
.grades dd { margin: 0; }
section { margin-top: 3.2rem; padding-top: 1.6rem; border-top: 2px solid var(--ink); }
section.absent { border-top-color: var(--line); color: var(--soft); }
.about { color: var(--soft); margin: 0 0 1rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; margin: .4rem 0 .6rem; }
th, td { padding: .38rem .7rem; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
thead th { font-weight: 600; border-bottom: 1.5px solid var(--ink); vertical-align: bottom; }
tbody th { font-weight: 400; }
table.pair { width: 100%; }
table.pair tbody th { width: 32%; }
table.pair td.theirs { background: var(--wash-theirs); width: 17%; }
table.pair td.ours { background: var(--wash-ours); font-weight: 600; width: 21%; }
th.theirs, span.theirs { color: var(--theirs); font-weight: 600; }
th.ours, span.ours { color: var(--ours); font-weight: 600; }
td.remark { color: var(--soft); }
table.more td { text-align: right; }
table.more thead th { text-align: right; max-width: 11rem; }
table.more thead th:first-child { text-align: left; }
.unit { color: var(--soft); white-space: nowrap; }
.unit::before { content: "["; } .unit::after { content: "]"; }
.grade { display: inline-block; min-width: 1.25em; padding: 0 .3em; border-radius: 4px; font-size: .72rem;
  font-weight: 700; text-align: center; color: #fff; background: #5b6880; }
.grade.S { background: #1d6f4f; } .grade.I { background: #6a4c93; } .grade.D { background: #33658a; }
.grade.U { background: #fff; color: var(--soft); box-shadow: inset 0 0 0 1px var(--soft); }
figure { margin: 1.2rem 0; }
figure img { display: block; max-width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: .86rem; margin-top: .4rem; max-width: 52rem; }
.words { display: grid; grid-template-columns: 1fr 1fr; gap: 0 2.2rem; font-size: .93rem; }
.words h3 { margin-top: .8rem; }
.limits { margin: 1rem 0; padding: .2rem 1.1rem .7rem; background: var(--pale); border-left: 3px solid var(--theirs);
  border-radius: 0 8px 8px 0; font-size: .93rem; }
.limits h3 { margin-top: .7rem; } .limits ul { margin: .2rem 0; padding-left: 1.1rem; }
.note, .missing { color: var(--soft); font-size: .86rem; }
details { margin-top: 1rem; font-size: .86rem; color: var(--soft); } summary { cursor: pointer; }
.facts { display: grid; grid-template-columns: max-content 1fr; gap: .1rem 1rem; margin: .5rem 0; }
.facts dt { font-weight: 600; } .facts dd { margin: 0; }
footer { margin-top: 4rem; color: var(--soft); font-size: .86rem; }
@media (max-width: 62rem) { body { display: block; } nav { position: static; height: auto; border: 0; }
  main { padding: 1.5rem 1.2rem 3rem; } .words { grid-template-columns: 1fr; } }
@media print { nav { display: none; } body { display: block; font-size: 10.5pt; } main { padding: 0; max-width: none; }
  section { break-inside: auto; } figure, tr, .limits { break-inside: avoid; } details { display: none; } }
"""
