// viser's canvas lies over the slot of its card, wherever that stands and as long as it can be seen. It moves in the very
// frame in which its card does, so that a finger that scrolls sees one card; only another size makes viser draw anew.
(() => {
  const SIDES = ["left", "top", "width", "height"];
  let placed = "";
  let size = "";
  let node = null;
  let settling = 0;
  const place = () => {
    const frame = document.querySelector("[data-dock-root] > div:has(> canvas)");
    const slot = document.querySelector(".etv-scene-slot");
    const box = slot?.checkVisibility() ? slot.getBoundingClientRect() : null;
    const sides = box && box.width > 20 ? SIDES.map((side) => Math.round(box[side])) : [];
    if (!frame || (sides.join() === placed && frame === node)) return;
    [placed, node] = [sides.join(), frame];
    for (const [i, side] of SIDES.entries()) {
      if (sides.length) frame.style.setProperty(`--scene-${side}`, `${sides[i]}px`);
      else frame.style.removeProperty(`--scene-${side}`);
    }
    const measure = () => window.dispatchEvent(new Event("resize")); // viser measures its canvas then
    clearTimeout(settling);
    if (sides.slice(2).join() === size) settling = setTimeout(measure, 200);
    else measure();
    size = sides.slice(2).join();
  };

  // On a narrow window viser folds every panel and makes what is folded deaf to fingers. The style sheet shows it all.
  const FOLDED = "[inert]:is(:has(.etv-page-mark, .etv-strip, .etv-demo, .etv-demo-bar, .etv-card, .etv-bar))";
  const unfold = () => {
    for (const folded of document.querySelectorAll(FOLDED)) {
      folded.inert = false;
      folded.removeAttribute("aria-hidden");
    }
  };
  for (const moved of ["scroll", "resize"]) window.addEventListener(moved, place, { capture: true, passive: true });
  let owed = 0; // a card of the shelf goes to the stage, a workspace opens
  const look = () => (owed ||= requestAnimationFrame(() => ((owed = 0), place())));
  new MutationObserver(look).observe(document.body, { childList: true, subtree: true });
  setInterval(() => (unfold(), place()), 100);

  // While a group guesses what the events are, the scene turns to and fro, and then stands as it stood.
  const TURN = 0.6; // radians to each side
  const ROUND = 9; // seconds
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  let began = 0;
  let turned = 0;
  setInterval(() => {
    const control = window.__viserMutable?.cameraControl;
    const isGuessing = document.querySelector(".etv-veiled") !== null && !still.matches;
    if (!control || (!isGuessing && !turned)) return;
    began = isGuessing ? began || performance.now() : 0;
    const angle = isGuessing ? TURN * Math.sin((2 * Math.PI * (performance.now() - began)) / 1000 / ROUND) : 0;
    control.rotate(angle - turned, 0, false);
    turned = angle;
  }, 50);

  // A button whose HTML is replaced between press and release gets no click from the browser; it gets this one.
  let pressed = null;
  const buttonAt = (element) => element?.closest?.("button, summary, a[href]");
  document.addEventListener("pointerdown", (event) => (pressed = buttonAt(event.target)), { capture: true, passive: true });
  document.addEventListener(
    "pointerup",
    (event) => {
      const was = pressed;
      pressed = null;
      if (!was || was.isConnected || was.dataset.pick !== undefined) return;
      const now = buttonAt(document.elementFromPoint(event.clientX, event.clientY));
      if (now && now.innerText === was.innerText && now.className === was.className) now.click();
    },
    { capture: true, passive: true },
  );
})();
