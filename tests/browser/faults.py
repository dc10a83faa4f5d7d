"""What may not be seen on any page, found in the page itself: the browser tests and `make pictures` share it."""

CHROME = (
    "[data-dock-griphandle]",
    "[data-dock-strip]",
    "[data-dock-tab]",
    "[data-dock-resize]",
    "[data-dock-minimize]",
    "[data-dock-region-handle]",
    "[data-dock-region-resize]",
    "[data-dock-region-collapse]",
    "[data-testid='floating-panel-handle']",
)
"""Parts of viser's panels by which a person could move, fold or close them."""

FAULTS = """() => {
  const faults = [];
  const isShown = (e) => e.checkVisibility({ opacityProperty: true, visibilityProperty: true });
  const isSeen = (e) => isShown(e) && e.getBoundingClientRect().width > 2 && e.getBoundingClientRect().height > 2;
  const words = (e) => (e.innerText || e.ariaLabel || e.title || e.tagName).trim().slice(0, 40);
  const named = (e) => e.dataset.card || e.dataset.testid || e.className || e.tagName;
  const page = document.documentElement;
  if (page.scrollWidth > innerWidth) faults.push(`the page is ${page.scrollWidth - innerWidth} px too wide`);

  const cards = [...document.querySelectorAll(".etv-card")].filter(isSeen);
  for (const card of cards) {
    const body = card.querySelector(".etv-body") ?? card;
    const holds = body.innerText.trim() || body.querySelector("img, svg, .etv-scene-slot");
    if (body.getBoundingClientRect().height < 8 || !holds) faults.push(`${named(card)} is empty`);
    const box = card.getBoundingClientRect();
    const strip = [...document.querySelectorAll(".etv-strip")].find(isSeen);
    const foot = strip?.getBoundingClientRect().top ?? innerHeight;
    const isOut = box.right > innerWidth + 1 || box.bottom > foot + 1;
    if (innerWidth > 600 && isOut) faults.push(`${named(card)} sticks out`);
  }
  const inner = [".etv-body", ".et-table", ".mantine-ScrollArea-viewport", "[data-dock-scroll]", ".etv-demo"].join();
  for (const part of [...document.querySelectorAll(inner)].filter(isSeen)) {
    const over = part.scrollWidth - part.clientWidth;
    if (over > 1) faults.push(`${named(part.closest("[data-card]") ?? part)} holds what is ${over} px too wide`);
  }

  // Words of headings and controls: neither wider than their box, nor cut by one around them. Notes may be shortened.
  const heads = "h1, h2, h3, h4, th, summary, button, [role=button], .et-chip, .et-legend-ticks > span, .et-swatch";
  for (const part of [...document.querySelectorAll(heads)].filter(isSeen)) {
    if (part.closest(".etv-note, .etv-list, .mantine-Notifications-root")) continue;
    const isWide = part.clientWidth > 2 && part.scrollWidth > part.clientWidth + 1;
    if (isWide) faults.push(`"${words(part)}" is wider than its box`);
    const box = part.getBoundingClientRect();
    for (let around = part.parentElement; around && around !== document.body; around = around.parentElement) {
      const style = getComputedStyle(around);
      if (style.position === "fixed") break;
      if (!["hidden", "clip"].includes(style.overflowX)) continue;
      const edge = around.getBoundingClientRect();
      if (edge.width > 2 && (box.left < edge.left - 2 || box.right > edge.right + 2)) {
        faults.push(`"${words(part)}" is cut off by ${named(around)}`);
        break;
      }
    }
  }
  for (const image of [...document.querySelectorAll(".et img, .etv-bar img")].filter(isShown)) {
    const isBroken = image.complete && image.naturalWidth === 0;
    if (isBroken) faults.push(`a picture of ${named(image.closest(".et, .etv-bar"))} is broken`);
  }

  const parts = ".etv-bar, .etv-card:not(.etv-measure), .etv-figure, .etv-demo-bar, [data-dock-region=right]";
  const blocks = [...document.querySelectorAll(parts)];
  const strip = document.querySelector(".etv-strip")?.closest("[data-floating-window]");
  if (strip) blocks.push(strip);
  const seen = blocks.filter(isSeen);
  for (let i = 0; i < seen.length; i++) for (let j = i + 1; j < seen.length; j++) {
    if (seen[i].contains(seen[j]) || seen[j].contains(seen[i])) continue;
    const a = seen[i].getBoundingClientRect(), b = seen[j].getBoundingClientRect();
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
    const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 1 && down > 1) faults.push(`${named(seen[i])} overlaps ${named(seen[j])}`);
  }

  // What lies over what in one card: badges and captions of a picture.
  for (const card of cards) {
    const badges = ".et-chip, .et-chips .et-note, .et-caption > span, .et-lag";
    const marks = [...card.querySelectorAll(badges)].filter(isSeen);
    for (let i = 0; i < marks.length; i++) for (let j = i + 1; j < marks.length; j++) {
      if (marks[i].contains(marks[j]) || marks[j].contains(marks[i])) continue;
      const a = marks[i].getBoundingClientRect(), b = marks[j].getBoundingClientRect();
      const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (across > 1 && down > 1) faults.push(`"${words(marks[i])}" lies over "${words(marks[j])}"`);
    }
  }
  return [...new Set(faults)];
}"""
"""A list of sentences; empty where all is well."""

SCENE = """() => {
  const slot = [...document.querySelectorAll(".etv-scene-slot")].find((e) => e.checkVisibility());
  const canvas = document.querySelector("canvas[data-engine]").getBoundingClientRect();
  const frame = document.querySelector("canvas[data-engine]").closest("[data-dock-root] > div").getBoundingClientRect();
  if (!slot) return frame.right <= 0 || frame.bottom <= 0 || frame.left >= innerWidth || frame.top >= innerHeight;
  const place = slot.getBoundingClientRect();
  return ["left", "top", "width", "height"].every((side) => Math.abs(canvas[side] - place[side]) <= 1.5);
}"""
"""Whether viser's canvas lies exactly over the slot of its card, and out of sight where there is none."""

SETTLED = """() => {
  const shown = (e) => e.checkVisibility();
  const waits = [...document.querySelectorAll(".et-lag")].some(shown);
  const images = [...document.querySelectorAll(".et img")].filter(shown);
  return !waits && images.every((image) => image.complete);
}"""
"""Whether nothing is being computed and every picture is there."""
