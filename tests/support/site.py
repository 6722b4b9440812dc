"""The site as it is built: served to a browser, and looked at by scripts in its pages."""

from __future__ import annotations

import functools
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

ROOT = Path(__file__).parents[2]

# Texts whose contrast with what is behind them is less than AA asks for (WCAG 2.2, 1.4.3): 4.5, of
# large ones 3. Colours are blended in the order in which they lie over each other.
LOW_CONTRAST = """(() => {
  for (const running of document.getAnimations()) running.finish();  // colours as they stay
  const colour = text => {
    const [r, g, b, a = 1] = text.match(/[\\d.]+/g).map(Number);
    const full = text.startsWith('color(srgb') ? 255 : 1;  // as it is of mixed ones
    return [full * r, full * g, full * b, a];
  };
  const over = (top, below) => below.map((value, i) => top[3] * top[i] + (1 - top[3]) * value);
  const background = element => {
    const layers = [];
    for (let e = element; e; e = e.parentElement)
      layers.unshift(colour(getComputedStyle(e).backgroundColor));
    return layers.reduce((below, top) => over(top, below), [255, 255, 255]);
  };
  const luminance = rgb => rgb
    .map(v => v / 255)
    .map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const found = new Set();
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let text = texts.nextNode(); text; text = texts.nextNode()) {
    const element = text.parentElement;
    const seen = element.checkVisibility({opacityProperty: true, visibilityProperty: true});
    if (!seen || !text.data.trim()) continue;
    if (element.closest('script, style, [disabled], [aria-hidden=true]')) continue;
    const style = getComputedStyle(element);
    const behind = background(element);
    const shades = [luminance(over(colour(style.color), behind)), luminance(behind)];
    const ratio = (Math.max(...shades) + 0.05) / (Math.min(...shades) + 0.05);
    const size = parseFloat(style.fontSize);
    const large = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    if (ratio < (large ? 3 : 4.5))
      found.add(`${ratio.toFixed(2)} ${element.outerHTML.slice(0, 80)}`);
  }
  return [...found];
})()"""

# What scrolls and cannot be reached by Tab, what is reached out of order, what has no name.
UNREACHABLE = """(() => {
  const shown = e => e.checkVisibility({visibilityProperty: true}) && e.getClientRects().length;
  const scrolls = e => e.scrollWidth > e.clientWidth + 1
    && ['auto', 'scroll'].includes(getComputedStyle(e).overflowX);
  const reached = 'a[href], button, input, [tabindex="0"]';
  const named = e => e.textContent.trim() || e.ariaLabel || e.title || e.placeholder
    || e.querySelector('img[alt]:not([alt=""])') || e.labels?.length
    || document.getElementById(e.getAttribute('aria-labelledby'));
  const about = (what, e) => `${what}: ${e.outerHTML.slice(0, 100)}`;
  const all = [...document.querySelectorAll('body *')].filter(shown);
  return [
    ...all.filter(e => scrolls(e) && !e.matches(reached) && !e.querySelector(reached))
      .map(e => about('scrolls', e)),
    ...all.filter(e => e.tabIndex > 0).map(e => about('out of order', e)),
    ...all.filter(e => e.matches('a[href], button, input') && !named(e))
      .map(e => about('nameless', e)),
  ];
})()"""


def build(out: Path, *options: str, address: str = "") -> subprocess.CompletedProcess[str]:
    """Build the site, as one of the versions at an address if there is one."""
    return subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-c", "docs/site", *options, ".", str(out)],
        cwd=ROOT,
        env={**os.environ, "PPY_SITE_ADDRESS": address},
        capture_output=True,
        text=True,
        timeout=1500,
    )


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, format: str, *arguments: object) -> None:
        pass


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """Serve a folder on this machine; gives the address."""
    handler = functools.partial(_Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
