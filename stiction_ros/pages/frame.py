"""The frame of every page: one file with its style, and nothing that is fetched."""

import html
import re
from collections.abc import Iterable
from string import Template

from stiction_ros import __version__

STYLE = """
:root { color-scheme: light dark; --paper: #fff; --panel: #f5f6f8; --ink: #1c2025;
  --soft: #56606b; --line: #d9dee3; --bad: #a8400a; --good: #00704f; --open: #63686f;
  --pv: #0067a5; --op: #b35c00; --stem: #00755a; --sp: #6d4b8d; --free: #b04a78; }
@media screen and (prefers-color-scheme: dark) { :root { --paper: #15181c; --panel: #1e2227;
  --ink: #e8eaed; --soft: #a6aeb7; --line: #363c44; --bad: #f3a06c; --good: #55cfab;
  --open: #b4b8be; --pv: #6db8ec; --op: #f0a848; --stem: #4fd0a8; --sp: #c3a2e4;
  --free: #eb9cc0; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 20px 60px; }
main.full { max-width: 1600px; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 4px; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 34px 0 8px; }
p, li { margin: 8px 0; max-width: 80ch; overflow-wrap: anywhere; }
li { margin: 3px 0; }
a { color: var(--pv); }
:focus-visible { outline: 3px solid var(--pv); outline-offset: 2px; }
.lead { font-size: 1.08rem; }
.soft, footer, figcaption { color: var(--soft); font-size: .9rem; }
footer { margin-top: 44px; }
sub { font-size: .72em; line-height: 0; }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(160px, 1fr)); gap: 10px;
  margin: 16px 0; }
.cards:has(.more:not(:empty)) { grid-template-columns: repeat(auto-fit, minmax(250px, 1fr)); }
.card { background: var(--panel); border: 1px solid var(--line); border-radius: 8px;
  padding: 9px 13px; overflow-wrap: anywhere; }
.card.open { border-left: 5px solid var(--open); }
.card.bad { border-left: 5px solid var(--bad); } .card.good { border-left: 5px solid var(--good); }
.card .what { color: var(--soft); font-size: .86rem; }
.card .big { font-size: 1.25rem; font-weight: 650; line-height: 1.35; }
.card .more { font-size: .9rem; }
.bad .big, td.bad { color: var(--bad); } .good .big, td.good { color: var(--good); }
.tools { display: flex; flex-wrap: wrap; gap: 8px 10px; margin: 14px 0; align-items: center; }
.tools input, .tools select { font: inherit; color: inherit; background: var(--panel);
  border: 1px solid var(--soft); border-radius: 7px; padding: 6px 9px; max-width: 100%; }
.tools input { flex: 1 1 200px; min-width: 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; min-width: 60%; font-size: .92rem; margin: 10px 0;
  font-variant-numeric: tabular-nums; }
th, td { padding: 6px 12px 6px 0; border-bottom: 1px solid var(--line); text-align: right;
  vertical-align: top; }
th { color: var(--soft); font-weight: 600; vertical-align: bottom; }
table:not(.list) td:not(.t) { white-space: nowrap; }
th button { font: inherit; color: inherit; background: none; border: 0; padding: 2px 0;
  cursor: pointer; font-weight: 600; text-align: inherit; }
th[aria-sort=ascending] button::after { content: " ▲"; }
th[aria-sort=descending] button::after { content: " ▼"; }
td.t, th.t, tbody th { text-align: left; }
tbody th { color: inherit; vertical-align: top; }
table:not(.list) td.t { overflow-wrap: break-word; min-width: 7ch; }
.name { overflow-wrap: break-word; } td.wordy { overflow-wrap: anywhere; min-width: 14ch; }
::placeholder { color: var(--soft); opacity: 1; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 3px 16px; font-size: .92rem; }
dt { font-weight: 600; } dd { margin: 0; max-width: 80ch; }
table.list { width: 100%; font-size: .84rem; }
table.list .name { min-width: 12ch; }
td.s, td.trend { white-space: nowrap; }
.sticky, .backlash, .failed { color: var(--bad); font-weight: 600; }
.healthy { color: var(--good); } .undecided, .skipped { color: var(--open); }
.note { border-left: 4px solid var(--open); background: var(--panel); padding: 8px 12px;
  border-radius: 5px; }
.note.warn { border-left-color: var(--bad); }
details { margin: 10px 0; border: 1px solid var(--line); border-radius: 8px; padding: 8px 14px; }
summary { cursor: pointer; }
pre { overflow-x: auto; font-size: .82rem; line-height: 1.45; }
figure { margin: 18px 0; } figcaption { margin-top: 4px; max-width: 90ch; }
.plot svg { display: block; touch-action: pan-y; overflow: hidden; }
.square > svg { width: 100%; height: auto; }
.plot > .over { overflow: visible; width: calc(100% - 92px); margin: 8px 24px 28px 68px; }
.plot text { fill: var(--soft); font-size: 12px; } .square text { font-size: 9.5px; }
.plot .mark { color: var(--ink); stroke-dasharray: 4 4; }
.plot .frame { fill: none; stroke: var(--line); }
.plot .grid { stroke: var(--line); stroke-width: 1; }
.plot polyline { fill: none; stroke: currentColor; stroke-width: 1.3;
  vector-effect: non-scaling-stroke; }
.pv { color: var(--pv); } .op { color: var(--op); } .stem { color: var(--stem); }
.sp { color: var(--sp); } .free { color: var(--free); } .ink { color: var(--ink); }
.whole, .diagonal { color: var(--soft); }
.plot .sp { stroke-dasharray: 5 3; } .plot .ink { stroke-width: 4; opacity: .45; }
.plot .shade { fill: var(--soft); opacity: .14; }
.plot .whole { stroke-width: .7; } .plot .diagonal { stroke-dasharray: 4 4; }
.key { display: flex; flex-wrap: wrap; gap: 3px 16px; font-size: .9rem; margin: 2px 0; }
.key i { display: inline-block; width: 20px; border-top: 3px solid; margin: 0 6px 4px 0; }
.key .sp, .key .diagonal { border-top-style: dashed; }
.pair { display: grid; gap: 0 24px;
  grid-template-columns: repeat(auto-fit, minmax(min(280px, 100%), 460px)); }
.zoom { display: flex; flex-wrap: wrap; gap: 6px; margin: 14px 0 -8px; }
.zoom button { font: inherit; font-size: .82rem; color: var(--ink); background: var(--panel);
  border: 1px solid var(--soft); border-radius: 6px; padding: 2px 9px; min-height: 26px; }
svg.spark { width: 92px; height: 22px; vertical-align: middle; }
table.list td.trend svg { display: block; margin-left: auto; }
svg.spark polyline { fill: none; stroke: var(--stem); stroke-width: 1.5; }
.hidden { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%);
  white-space: nowrap; }
@media (max-width: 760px) {
  main { padding: 18px 14px 44px; }
  dl { display: block; } dd { margin: 0 0 6px; }
  table.list, table.list thead, table.list tbody { display: block; }
  table.list { font-size: .92rem; }
  table.list tr { display: grid; grid-template-columns: 1fr 1fr; gap: 0 14px; padding: 9px 0;
    border-bottom: 1px solid var(--line); }
  table.list thead tr { display: flex; flex-wrap: wrap; gap: 0 16px; align-items: baseline; }
  table.list thead tr::before { content: "Sort by"; color: var(--soft); }
  table.list thead .name { min-width: 0; }
  table.list th button { min-height: 30px; text-decoration: underline; }
  table.list tr[hidden] { display: none; }
  table.list td, table.list th { border: 0; padding: 2px 0; text-align: left; min-width: 0;
    white-space: normal; }
  table.list td.none { display: none; }
  table.list td::before { content: attr(data-label) " "; color: var(--soft); font-weight: 400; }
  table.list .name, table.list td.wordy, table.list td.trend { grid-column: 1 / -1; }
  table.list td.trend svg { display: inline-block; margin-left: 6px; }
  .plot .x text:nth-child(even) { display: none; }
  table.list td { order: 1; } table.list .name { order: 0; }
}
@media print { :root { color-scheme: light; } main, main.full { max-width: none; padding: 0; }
  .tools, .zoom { display: none; } tr, figure { break-inside: avoid; }
  thead { display: table-header-group; } a { color: inherit; text-decoration: none; } }
"""

SCROLLED = '<div class="wide" tabindex="0" role="group" aria-label="wide table or picture">'
"""What is wider than a phone is scrolled in, also by the keyboard."""

_PAGE = Template(
    """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title</title>
<style>$style</style>
</head>
<body>
<main$kind>
$body
<footer>$footer</footer>
</main>$script
</body>
</html>
"""
)


def framed(title: str, parts: Iterable[str], script: str = "", *, full: bool = False) -> str:
    """Return a whole page; ``parts`` are HTML, ``title`` is words, ``full`` takes a wide window."""
    return _PAGE.substitute(
        title=text(title),
        style=STYLE,
        kind=' class="full"' * full,
        body="\n".join(part for part in parts if part),
        footer=f"stiction_ros {__version__}",
        script=f"\n<script>{script}</script>" if script else "",
    )


def text(value: object) -> str:
    """Return ``value`` for HTML."""
    return html.escape(str(value), quote=True)


def words(value: object) -> str:
    """Return ``value`` for HTML with f_S and f_D set as symbols, code and lines kept."""
    return (
        re.sub("`([^`]+)`", r"<code>\1</code>", text(value))
        .replace("f_S", "f<sub>S</sub>")
        .replace("f_D", "f<sub>D</sub>")
        .replace("\n", "<br>")
    )


def listed(lines: Iterable[object]) -> str:
    """Return lines of words as a list."""
    return "<ul>" + "".join(f"<li>{text(line)}</li>" for line in lines) + "</ul>"
