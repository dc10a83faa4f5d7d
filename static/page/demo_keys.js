// Arrow keys, and a gamepad, for the demo: kiosks have no mouse. They move the spot that the network is asked about; on
// the slider they move through time. A gamepad's first button plays, its second goes back to the events.
(() => {
  const STEP = 0.05; // of the picture's width
  const REPEAT = 140;
  const say = window.etnetSay;
  const isDemo = () => document.querySelector('[data-etv-workspace="demo"]') !== null;
  const inside = (f) => Math.min(Math.max(f, 0), 0.99999);
  let spot = [0.5, 0.5];

  const move = (dx, dy) => {
    const ring = document.querySelector(".etv-image .et-cross");
    if (ring) spot = ["--u", "--v"].map((name) => Number(ring.style.getPropertyValue(name)));
    spot = [inside(spot[0] + dx * STEP), inside(spot[1] + dy * STEP * 1.33)];
    say("pick", "pixel", spot[0].toFixed(4), spot[1].toFixed(4));
  };
  const scrub = (by) => {
    const track = document.querySelector(".etv-track[data-k]");
    if (!track) return;
    const [now, begin, end] = ["now", "min", "max"].map((name) => Number(track.getAttribute(`aria-value${name}`)));
    say("pick", track.dataset.k, inside((now - begin) / (end - begin) + by * 0.02).toFixed(5), 0);
  };
  const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  let last = 0;
  window.addEventListener(
    "keydown",
    (event) => {
      const way = KEYS[event.key];
      if (!way || !isDemo() || event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input")) return;
      event.preventDefault();
      event.stopPropagation();
      if (event.timeStamp - last < 60) return;
      last = event.timeStamp;
      say("touch");
      if (event.target.closest?.(".etv-track")) scrub(way[0] || -way[1]);
      else move(...way);
    },
    { capture: true },
  );

  // Chromium speaks of a gamepad only once one of its buttons was pressed.
  let held = [];
  let movedAt = 0;
  setInterval(() => {
    if (!isDemo()) return;
    for (const pad of navigator.getGamepads?.() ?? []) {
      if (!pad) continue;
      const pressed = pad.buttons.map((button) => button.pressed);
      const fresh = (number) => pressed[number] && !held[number];
      const x = Math.abs(pad.axes[0] ?? 0) > 0.5 ? Math.sign(pad.axes[0]) : (pressed[15] ? 1 : 0) - (pressed[14] ? 1 : 0);
      const y = Math.abs(pad.axes[1] ?? 0) > 0.5 ? Math.sign(pad.axes[1]) : (pressed[13] ? 1 : 0) - (pressed[12] ? 1 : 0);
      // A stick that is held repeats; a button counts each time that it goes down, however soon after a move.
      const isMove = (x || y) && performance.now() - movedAt > REPEAT;
      if (isMove || fresh(0) || fresh(1)) say("touch");
      if (isMove) {
        movedAt = performance.now();
        move(x, y);
      }
      if (fresh(0)) say("pick", "demo:play", 0, 0);
      if (fresh(1)) say("pick", "demo:cloud", 0, 0);
      held = pressed;
      return;
    }
  }, 40);
})();
