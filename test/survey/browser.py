"""Pages in headless Chromium: what a reader would see of them."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

_BEFORE = """<script>
window.said = [];
addEventListener("error", event => said.push(String(event.message)));
addEventListener("unhandledrejection", event => said.push(String(event.reason)));
for (const kind of ["error", "warn"]) console[kind] = (...words) => said.push(words.join(" "));
</script>"""

_AFTER = """<script>
addEventListener("load", () => {
  const seen = element => element.getClientRects().length > 0;
  const scrolled = element => element.closest(".wide") !== null || element.closest("svg svg");
  const all = [...document.body.querySelectorAll("*")].filter(seen);
  const wide = all.filter(element => !scrolled(element) &&
    element.getBoundingClientRect().right > innerWidth + 1).map(element => element.outerHTML);
  const texts = [...document.querySelectorAll("h1, h2, .card, figcaption, .name, th button")];
  const channel = value => { value /= 255;
    return value <= 0.04045 ? value / 12.92 : Math.pow((value + 0.055) / 1.055, 2.4); };
  const light = colour => { const [r, g, b] = colour.match(/[\\d.]+/g).map(Number);
    return 0.2126 * channel(r) + 0.7152 * channel(g) + 0.0722 * channel(b); };
  const paper = light(getComputedStyle(document.body).backgroundColor);
  const behind = element => { for (let at = element; at; at = at.parentElement) {
    const colour = getComputedStyle(at).backgroundColor;
    if (!colour.endsWith(", 0)")) return light(colour); }
    return paper; };
  const contrast = (element, colour) => { const own = light(colour), back = behind(element);
    return (Math.max(own, back) + 0.05) / (Math.min(own, back) + 0.05); };
  const speaks = element => [...element.childNodes].some(one => one.nodeType === 3 &&
    one.textContent.trim());
  const faint = element => { const style = getComputedStyle(element);
    if (element.tagName === "polyline") return contrast(element, style.stroke) < 3;
    return speaks(element) && contrast(element,
      element.tagName === "text" ? style.fill : style.color) < 4.5; };
  const enabled = all.filter(element => !element.disabled);
  const pale = enabled.filter(faint).map(element => element.outerHTML);
  const named = element => element.getAttribute("aria-label") || element.getAttribute("alt") ||
    element.textContent.trim();
  const heads = [...document.querySelectorAll("h1, h2, h3")].map(one => +one.tagName[1]);
  const ids = [...document.querySelectorAll("[id]")].map(one => one.id);
  const broken = [
    ...[...document.querySelectorAll("button, input, select, a, img, [role=img], [role=group]")]
      .filter(one => !named(one)).map(one => "no name: " + one.outerHTML),
    ...[...document.querySelectorAll("th")].filter(one => !one.scope || !one.textContent.trim())
      .map(one => "no head: " + one.outerHTML),
    ...[...document.querySelectorAll("table")].filter(one => !one.querySelector("th"))
      .map(() => "a table without heads"),
    ...all.filter(one => one.scrollWidth > one.clientWidth + 1 && one.tabIndex < 0 &&
      getComputedStyle(one).overflowX === "auto").map(one => "no keyboard: " + one.className),
    ...heads.filter((level, k) => k ? level > heads[k - 1] + 1 || level === 1 : level !== 1)
      .map(level => "heading out of order: h" + level),
    ...ids.filter((id, k) => ids.indexOf(id) !== k).map(id => "twice: " + id),
    ...(document.documentElement.lang && document.title ? [] : ["no language or no title"]),
    ...(document.querySelectorAll("main").length === 1 ? [] : ["no main part"])];
  let acted = {};
  try { acted = (() => { ACT })() || {}; } catch (error) { said.push(String(error)); }
  parent.postMessage(JSON.stringify({
    width: innerWidth, scroll: document.documentElement.scrollWidth,
    dark: matchMedia("(prefers-color-scheme: dark)").matches, wide: wide.slice(0, 3),
    empty: texts.filter(element => seen(element) && !element.innerText.trim()).length,
    pale: pale.slice(0, 3), broken: broken.slice(0, 3), paper, said, acted,
    fetched: performance.getEntriesByType("resource").map(one => one.name),
    text: document.body.innerText }), "*");
});
</script>"""

# A window is never narrower than 500 pixels, a frame may be; media queries go by the frame.
_OUTER = """<!DOCTYPE html><html><body style="margin:0"><script>
addEventListener("message", event => { document.documentElement.dataset.probe = event.data; });
</script><iframe src="PAGE" style="border:0;width:WIDTHpx;height:900px"></iframe></body></html>"""


def chromium() -> str | None:
    """Return the browser; None where there is none."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def probe(page: Path, width: int, *, dark: bool, act: str = "") -> dict[str, Any]:
    """Return what a page shows at a width; ``act`` is script whose value comes as ``acted``."""
    browser = chromium()
    assert browser is not None
    source = page.read_text(encoding="utf-8")
    source = source.replace("<head>", "<head>" + _BEFORE, 1)
    source = source.replace("</body>", _AFTER.replace("ACT", act) + "</body>", 1)
    copy = page.with_name(f"probe-{page.stem}.html")
    copy.write_text(source, encoding="utf-8")
    outer = page.with_name(f"frame-{page.stem}.html")
    outer.write_text(_OUTER.replace("PAGE", copy.name).replace("WIDTH", str(width)))
    done = subprocess.run(
        [
            browser,
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--hide-scrollbars",
            f"--user-data-dir={page.parent / 'browser'}",
            f"--window-size={max(width, 500) + 50},1000",
            f"--blink-settings=preferredColorScheme={0 if dark else 1}",
            "--virtual-time-budget=4000",
            "--dump-dom",
            outer.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    found = re.search(r'data-probe="([^"]*)"', done.stdout)
    assert found is not None, done.stderr[-2000:]
    seen: dict[str, Any] = json.loads(html.unescape(found[1]))
    return seen


needs_browser = pytest.mark.skipif(chromium() is None, reason="no Chromium is installed")


def check(seen: dict[str, Any], width: int, dark: bool) -> None:
    """Assert that a page can be read at a width, in light or dark, by eye, keyboard and ear."""
    assert seen["width"] == width
    assert seen["dark"] is dark
    assert (seen["paper"] < 0.2) is dark
    assert seen["scroll"] <= width, seen["wide"]
    assert seen["wide"] == [], seen["wide"]
    assert seen["said"] == [], seen["said"]
    assert seen["empty"] == 0
    assert seen["pale"] == [], seen["pale"]
    assert seen["broken"] == [], seen["broken"]
    assert seen["fetched"] == [], seen["fetched"]
