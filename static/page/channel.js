// The page's end of app/session/channel.py: what viser's widgets cannot say. Every message is a text "kind|…|counter".
(() => {
  let counter = Date.now();
  const say = (...parts) => {
    const page = window.__viserMutable;
    if (!page || !window.etnetChannel) return;
    const value = [...parts, ++counter].join("|");
    page.sendMessage({ type: "GuiUpdateMessage", uuid: window.etnetChannel, updates: { value } });
  };

  // One number a tab, kept while the tab lives: a reload finds its own view again, a second tab has another.
  const tab = () => {
    try {
      const kept = sessionStorage.getItem("etnet-tab");
      const number = kept ?? String(Math.floor(Math.random() * 256));
      sessionStorage.setItem("etnet-tab", number);
      return number;
    } catch {
      return "0";
    }
  };
  const size = () => [window.innerWidth, window.innerHeight];
  window.etnetHello = () => say("hello", tab(), ...size());

  // Clicks, and dragging over an image, which asks at every new place, at most 15 times a second.
  const isPixel = (element) => element?.dataset.k === "pixel";
  let held = null;
  let last = 0;
  const pick = (element, event) => {
    const box = element.getBoundingClientRect();
    const u = (event.clientX - box.left) / box.width;
    const v = (event.clientY - box.top) / box.height;
    const inside = (f) => Math.min(Math.max(f, 0), 0.99999).toFixed(5);
    say("pick", element.dataset.k, inside(u), inside(v));
  };
  document.addEventListener("pointerdown", (event) => {
    const element = event.target.closest?.("[data-pick]");
    if (!element || event.button !== 0) return;
    pick(element, event);
    held = isPixel(element) ? element : null;
  });
  document.addEventListener("pointermove", (event) => {
    if (!held || event.timeStamp - last < 66) return;
    last = event.timeStamp;
    const under = held.isConnected ? held : document.elementFromPoint(event.clientX, event.clientY)?.closest("[data-pick]");
    if (isPixel(under)) pick((held = under), event);
  });
  for (const end of ["pointerup", "pointercancel"]) document.addEventListener(end, () => (held = null));

  // In public the show lets go of the page at the first touch, wherever it is.
  let touched = 0;
  const touch = (event) => {
    if (!event.isTrusted || event.timeStamp - touched < 500 || !document.querySelector("[data-etv-public]")) return;
    touched = event.timeStamp;
    say("touch");
  };
  for (const kind of ["pointerdown", "keydown", "wheel"]) {
    document.addEventListener(kind, touch, { capture: true, passive: true });
  }

  // Keys that viser's commands do not know. Not while something is being typed.
  const keys = { ",": "comma", ".": "period", "?": "question" };
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input:not([type=checkbox]), textarea, [contenteditable=true]");
    if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey && keys[event.key]) say("key", keys[event.key]);
  });

  // viser's canvas lies over the slot of its card, wherever that stands and as long as it can be seen.
  let placed = "";
  const place = () => {
    const slot = document.querySelector(".etv-scene-slot");
    const box = slot?.checkVisibility() ? slot.getBoundingClientRect() : null;
    const now = box && box.width > 20 ? [box.left, box.top, box.width, box.height].map(Math.round).join() : "";
    if (now === placed) return;
    placed = now;
    const style = document.documentElement.style;
    for (const [i, side] of ["left", "top", "width", "height"].entries()) {
      if (now) style.setProperty(`--scene-${side}`, `${now.split(",")[i]}px`);
      else style.removeProperty(`--scene-${side}`);
    }
    window.dispatchEvent(new Event("resize")); // viser measures its canvas then
  };
  setInterval(place, 100);
  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => (place(), say("size", ...size())), 150);
  });

  // The list of recordings: what is typed leaves out what does not match; a choice, Escape or a click elsewhere closes it.
  const list = () => document.querySelector(".etv-recordings[open]");
  document.addEventListener("input", (event) => {
    if (!event.target.closest?.(".etv-list")) return;
    const words = event.target.value.toLowerCase().split(" ");
    for (const row of event.target.closest(".etv-list").querySelectorAll("button")) {
      row.hidden = !words.every((word) => row.innerText.toLowerCase().includes(word));
    }
  });
  document.addEventListener("click", (event) => {
    const open = list();
    if (open && (!open.contains(event.target) || event.target.closest("[data-k]"))) open.open = false;
    else if (open) open.querySelector("input").focus();
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && list()) list().open = false;
  });

  // A moment as a link: C copies the address of what is on show. The address that this page was opened by is told
  // once; on a reload the page rather returns to where it was.
  const copy = async () => {
    const moment = document.querySelector("[data-etv-moment]")?.dataset.etvMoment;
    if (!moment) return;
    const address = `${location.origin}${location.pathname}?moment=${moment}`;
    try {
      await navigator.clipboard.writeText(address);
      say("copied", 1);
    } catch {
      const field = document.createElement("textarea");
      field.value = address;
      document.body.append(field);
      field.select();
      const isDone = document.execCommand("copy");
      field.remove();
      say("copied", isDone ? 1 : 0);
    }
  };
  document.addEventListener("keydown", (event) => {
    const typing = event.target.closest?.("input:not([type=checkbox]), textarea, [contenteditable=true]");
    const plain = !event.ctrlKey && !event.metaKey && !event.altKey && !event.repeat;
    if (!typing && plain && event.key.toLowerCase() === "c") copy();
  });
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[data-etv-copy]")) copy();
  });
  const follow = () => {
    const moment = new URLSearchParams(location.search).get("moment");
    const kind = performance.getEntriesByType("navigation")[0]?.type;
    if (moment && !(kind === "reload" && sessionStorage.getItem("etnet-moment") === moment)) say("link", moment);
    try {
      sessionStorage.setItem("etnet-moment", moment ?? "");
    } catch {
      // a page that may keep nothing follows its address each time
    }
  };

  document.title = "ET-Net viewer"; // viser sets its own once it runs
  place();
  window.etnetHello();
  follow();
  for (const name of ["tour", "upload", "tidy"]) {
    const script = document.createElement("script");
    script.src = `/static/${name}.js`;
    document.head.append(script);
  }
})();
