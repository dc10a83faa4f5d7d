// The guided tour: steps that point at parts of the page. It is offered once to a browser, and can be left at any step;
// it knows the page only by what stands in it, and asks nothing of the server.
(() => {
  const EXPERT = [
    ["[data-card=events]:not([hidden])", "Events", "This sensor takes no pictures. Each pixel reports an <b>event</b> when it became brighter (orange) or darker (blue). A <b>window</b> is the events that make one image."],
    ["[data-card=voxels]:not([hidden])", "Network input", "The window, cut into five <b>bins</b> of its time (a voxel grid): in each, brighter counts up and darker counts down."],
    ["[data-card=reconstruction]:not([hidden])", "Reconstruction", "It is made of events alone. The network carries a <b>state</b> from window to window: its memory. Green <b>exact</b> means: the same, bit for bit, as a run from the start. <b>Click a pixel</b> to ask about it."],
    [".etv-bar > .etv-segmented", "Workspaces", "<b>Attention</b> shows which tokens (8 × 8 pixels) the network attends to at the pixel you clicked, <b>Compare</b> sets runs beside each other, <b>Recording</b> says what the file holds."],
    [".etv-strip", "Time", "Drag here, or press <kbd>space</kbd> to play and <kbd>←</kbd> <kbd>→</kbd> for the previous or next window. <kbd>C</kbd> copies a link to the moment, <kbd>?</kbd> explains every word."],
  ];
  const PUBLIC = [
    ["[data-card=scene], .etv-map", "Dots instead of pictures", "This camera takes no pictures. Each dot is one pixel that became brighter (orange) or darker (blue). Time runs away from you: drag to turn it."],
    [".etv-image", "An image made of dots", "A neural network paints this from the dots alone. It remembers what came before. <b>Touch a spot</b> to see where it looks."],
    [".etv-camera", "The ordinary camera", "What a normal camera saw at the same moment, to compare. The network never sees it."],
    [".etv-track", "Time", "Drag here to go back and on. The hills are moments in which much happened."],
    [".etv-ask", "Now you", "Touch a spot, look at your own face as dots, or take three seconds of this home."],
  ];
  const stepsHere = () => (document.querySelector('[data-etv-workspace="demo"]') ? PUBLIC : EXPERT);
  const KEY = "etnet-tour";
  const remembered = () => {
    try {
      return localStorage.getItem(KEY) !== null;
    } catch {
      return true; // a browser that may remember nothing would be asked each time
    }
  };
  const remember = () => {
    try {
      localStorage.setItem(KEY, "seen");
    } catch {
      // then it is offered again
    }
  };

  let steps = []; // those whose part is in sight: in public and on a phone not all are
  let step = -1;
  let card = null;
  let missed = 0; // looks in a row at which the part that is pointed at was not there
  let touchedAt = -Infinity;
  for (const kind of ["pointerdown", "keydown", "wheel"]) {
    document.addEventListener(kind, (event) => (touchedAt = event.timeStamp), { capture: true, passive: true });
  }
  const seen = (parts) =>
    [...document.querySelectorAll(parts)].find((element) => element.checkVisibility() && element.getBoundingClientRect().height > 0);
  const target = () => seen(steps[step][0]);
  const place = () => {
    if (!card) return;
    const frame = card.previousSibling;
    const box = target()?.getBoundingClientRect();
    frame.hidden = !box;
    const size = card.getBoundingClientRect();
    let left = (innerWidth - size.width) / 2;
    let top = (innerHeight - size.height) / 2;
    if (box) {
      const edge = 6;
      Object.assign(frame.style, { left: `${box.left - edge}px`, top: `${box.top - edge}px`, width: `${box.width + 2 * edge}px`, height: `${box.height + 2 * edge}px` });
      left = box.right + 24 + size.width < innerWidth ? box.right + 24 : box.left - size.width - 24 > 0 ? box.left - size.width - 24 : left;
      top = Math.min(Math.max(box.top, 60), innerHeight - size.height - 20);
      if (left + size.width > box.left && left < box.right) top = box.top - size.height - 20 > 50 ? box.top - size.height - 20 : box.bottom + 20;
    }
    const within = (value, most) => Math.max(8, Math.min(value, most - 8));
    Object.assign(card.style, { left: `${within(left, innerWidth - size.width)}px`, top: `${within(top, innerHeight - size.height)}px` });
  };
  const leave = () => {
    card?.parentNode.remove();
    card = null;
    step = -1;
    remember();
  };
  const show = (number) => {
    if (number >= steps.length) return leave();
    step = Math.max(number, 0);
    if (!card) {
      const layer = document.createElement("div");
      layer.className = "etv-tour";
      layer.innerHTML = '<i class="etv-tour-frame"></i><div class="etv-tour-card" role="dialog" aria-label="Guided tour" data-testid="tour"></div>';
      document.body.append(layer);
      card = layer.lastChild;
      card.addEventListener("click", (event) => {
        const go = event.target.closest("[data-go]")?.dataset.go;
        if (go === "next") show(step + 1);
        if (go === "back") show(step - 1);
        if (go === "leave") leave();
      });
    }
    const [, title, words] = steps[step];
    const next = step === steps.length - 1 ? "Done" : "Next";
    card.innerHTML = `<h3>${step + 1} of ${steps.length} · ${title}</h3><p>${words}</p><div><button data-go="leave">Skip tour</button>${step ? '<button data-go="back">Back</button>' : ""}<button data-go="next" class="etv-tour-next">${next}</button></div>`;
    card.querySelector(".etv-tour-next").focus({ preventScroll: true });
    target()?.scrollIntoView({ block: "nearest" });
    place();
  };
  const begin = () => {
    steps = stepsHere().filter(([parts]) => seen(parts));
    show(0);
  };
  document.addEventListener("keydown", (event) => {
    if (card && event.key === "Escape") leave();
  });
  document.addEventListener("click", (event) => {
    const asked = event.target.closest?.("[data-etv-tour]");
    if (!asked) return;
    // The help that it was asked from would lie over what is pointed at.
    const buttons = [...(asked.closest("[role=dialog]")?.querySelectorAll("button") ?? [])];
    buttons.find((button) => button.innerText.trim() === "Close")?.click();
    begin();
  });
  window.addEventListener("resize", place);
  // Parts move when pictures come. One that has gone (another workspace was opened) ends the tour: there is nothing to show.
  setInterval(() => {
    missed = card && !target() ? missed + 1 : 0;
    if (missed > 2) leave();
    else place();
  }, 500);

  // Offered when all is there to point at and nothing is going on, to a browser that has not had it, never on a phone or in public.
  const offer = () => {
    if (remembered() || innerWidth < 900) return;
    if (document.querySelector("[data-etv-public]")) return;
    const isAtWork = performance.now() - touchedAt < 5000 || document.querySelector(".etv-play[aria-label^=Pause]");
    const isBusy = isAtWork || [...document.querySelectorAll(".et-lag")].some((lag) => lag.checkVisibility());
    const isThere = document.querySelector("[data-testid=reconstruction] img") && EXPERT.every(([parts]) => seen(parts));
    if (isBusy || !isThere) return void setTimeout(offer, 500);
    begin();
  };
  setTimeout(offer, 1500);
})();
