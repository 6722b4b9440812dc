"""Questions to a page in a browser: what cannot be read, reached or seen on it."""

from __future__ import annotations

# texts whose contrast is below that of WCAG 2.1, level AA (1.4.3), for text of any size
FAINT = """(() => {
  const channels = colour => colour.match(/[\\d.]+/g).map(Number);
  const light = ([r, g, b]) => [r, g, b]
    .map(c => c / 255).map(c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const ground = e => {
    for (; e; e = e.parentElement) {
      const found = channels(getComputedStyle(e).backgroundColor);
      if (found.length < 4 || found[3] > 0) return found;
    }
    return [255, 255, 255];
  };
  const faint = new Set();
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = texts.nextNode(); node; node = texts.nextNode()) {
    const e = node.parentElement;
    if (!node.textContent.trim() || !e.getClientRects().length) continue;
    const [a, b] = [channels(getComputedStyle(e).color), ground(e)].map(light);
    const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (ratio < 4.5) faint.add(node.textContent.trim());
  }
  return [...faint];
})()"""
# places that scroll by themselves and that the keyboard does not reach
UNREACHED = """[...document.querySelectorAll("body *")]
  .filter(e => e.scrollWidth > e.clientWidth + 1 && e.tabIndex < 0)
  .filter(e => ["auto", "scroll"].includes(getComputedStyle(e).overflowX))
  .map(e => `${e.tagName} ${e.className}`)"""
# texts of charts that stand beyond the edges of the window
OUTSIDE = """[...document.querySelectorAll(".chart span, .chart p, .chart li")]
  .filter(e => e.getClientRects().length && !e.closest(".strip"))
  .filter(e => { const box = e.getBoundingClientRect();
    return box.left < 0 || box.right > innerWidth; })
  .map(e => e.textContent)"""
