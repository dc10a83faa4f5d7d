// The page's end of app/session/channel.py: what viser's widgets cannot say. Every message is a text "kind|…|counter".
// It runs before viser does: what a visitor does before there is anybody to tell is kept, and told first of all.
(() => {
  const MOST_UNSAID = 20;
  const unsaid = [];
  let counter = Date.now();
  let owedWords = 0;
  const tell = () => {
    clearTimeout(owedWords);
    const page = window.__viserMutable;
    if (!page?.sendMessage || !window.etnetChannel) {
      owedWords = setTimeout(tell, 30);
      return;
    }
    for (const parts of unsaid.splice(0)) {
      const value = [...parts, ++counter].join("|");
      page.sendMessage({ type: "GuiUpdateMessage", uuid: window.etnetChannel, updates: { value } });
      document.dispatchEvent(new CustomEvent("etnet-told", { detail: parts[0] }));
    }
  };
  const say = (...parts) => {
    if (unsaid.length < MOST_UNSAID) unsaid.push(parts);
    tell();
  };
  window.etnetSay = say;

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
  window.etnetHello = () => {
    document.title = "ET-Net viewer"; // viser sets its own once it runs
    unsaid.unshift(["hello", tab(), ...size()]);
    tell();
  };

  // Clicks; and dragging, over an image for a pixel and along an axis for a moment: at most 30 values a second, the last
  // one always. What is dragged keeps its place on the screen, though its HTML is replaced meanwhile. A finger on what is no
  // axis may yet begin to scroll: it presses once it is lifted where it was put down. In the demo, where
  // only sheets and the list of recordings scroll, it presses at once elsewhere.
  const STILL = 10; // CSS pixels within which a finger has not moved
  const isPixel = (element) => element?.dataset.k === "pixel" || element?.dataset.k.startsWith("cut:");
  const mayScroll = (element) => !document.querySelector('[data-etv-workspace="demo"]') || element.closest(".etv-sheet, .etv-list");
  const inside = (f) => Math.min(Math.max(f, 0), 0.99999);
  let held = null; // {key, box, isAxis}
  let waits = null; // the same of a finger that has not been lifted, with its {id, x, y}
  let last = 0;
  let owed = 0;
  const pick = (event, on = held) => {
    const u = inside((event.clientX - on.box.left) / on.box.width);
    const v = inside((event.clientY - on.box.top) / on.box.height);
    const mark = on.key.startsWith("mark:") && document.querySelector(`[data-k^="${on.key.slice(0, 7)}"]`); // the axis of a live one moves
    if (mark) mark.style.left = `${100 * u}%`;
    else if (on.isAxis) document.documentElement.style.setProperty("--drag-x", `${100 * u}%`);
    last = event.timeStamp;
    say("pick", on.key, u.toFixed(5), v.toFixed(5));
  };
  document.addEventListener("pointerdown", (event) => {
    const element = event.target.closest?.("[data-pick]");
    if (!element || event.button !== 0) return;
    const isAxis = element.dataset.drag !== undefined;
    const along = isAxis ? (element.closest(".et-axis") ?? element) : element;
    const pressed = { key: element.dataset.k, box: along.getBoundingClientRect(), isAxis };
    const isDragged = isAxis || isPixel(element);
    if (isDragged) event.preventDefault();
    if (event.pointerType === "touch" && !isAxis && mayScroll(element)) {
      waits = { ...pressed, id: event.pointerId, x: event.clientX, y: event.clientY };
      return;
    }
    held = pressed;
    giveBack(); // a field that is being typed into has lost its purpose
    pick(event);
    if (!isDragged) held = null;
  });
  const lift = (event, isLifted) => {
    const finger = waits;
    if (finger?.id !== event.pointerId) return;
    waits = null;
    if (!isLifted || Math.hypot(event.clientX - finger.x, event.clientY - finger.y) >= STILL) return;
    giveBack();
    pick(event, finger);
  };
  document.addEventListener("pointermove", (event) => {
    if (!held) return;
    clearTimeout(owed);
    if (event.timeStamp - last >= 33) pick(event);
    else owed = setTimeout(() => held && pick(event), 33);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    document.addEventListener(end, (event) => {
      lift(event, end === "pointerup");
      if (!held) return;
      clearTimeout(owed);
      if (end === "pointerup" && held.isAxis) pick(event);
      held = null;
      setTimeout(() => held || document.documentElement.style.removeProperty("--drag-x"), 400);
    });
  }

  // A button that has the focus is pressed by Enter, and by what reads the page aloud: a click that no pointer made.
  document.addEventListener("click", (event) => {
    const button = event.target.closest?.("button[data-pick]");
    if (button && event.detail === 0) say("pick", button.dataset.k, 0, 0);
  });

  // Along the timeline the pointer's time is shown, with its window and a small frame as soon as the server tells them.
  const hover = document.createElement("div");
  hover.className = "etv-hover";
  hover.hidden = true;
  hover.innerHTML = '<img alt="" hidden><span></span>';
  document.body.append(hover);
  const [thumbnail, told] = hover.children;
  let hovered = ""; // seconds, as they were said last
  let saidAt = 0;
  let owedHover = 0;
  const isPublic = () => document.querySelector("[data-etv-public]") !== null;
  const sayHover = (seconds) => {
    clearTimeout(owedHover);
    if (seconds === hovered || isPublic()) return;
    const wait = saidAt + 120 - performance.now();
    if (seconds !== "" && wait > 0) {
      owedHover = setTimeout(() => sayHover(seconds), wait);
      return;
    }
    hovered = seconds;
    saidAt = performance.now();
    say("hover", seconds);
  };
  const showHover = () => {
    const answer = document.querySelector(".etv-hovered");
    const isAnswered = answer?.dataset.at !== undefined && Math.abs(Number(answer.dataset.at) - Number(hovered)) < 1e-4;
    const picture = isAnswered ? answer.dataset.picture : "";
    if (isAnswered) told.textContent = answer.dataset.words;
    thumbnail.hidden = !picture;
    if (picture && thumbnail.getAttribute("src") !== picture) thumbnail.src = picture;
  };
  document.addEventListener("pointermove", (event) => {
    const axis = event.target.closest?.(".et-axis");
    hover.hidden = !axis;
    if (!axis) {
      if (hovered !== "") sayHover("");
      return;
    }
    const box = axis.getBoundingClientRect();
    const seconds = Number(axis.dataset.start ?? 0) + inside((event.clientX - box.left) / box.width) * Number(axis.dataset.duration);
    told.textContent = `${seconds.toFixed(3)} s`;
    const half = hover.offsetWidth / 2 + 4;
    const left = Math.min(Math.max(event.clientX, half), window.innerWidth - half);
    Object.assign(hover.style, { left: `${left}px`, top: `${box.top - 6}px` });
    sayHover(seconds.toFixed(4));
    showHover();
  });
  setInterval(() => hover.hidden || showHover(), 60);

  // The wheel and the keys + − 0 [ ] look closer at a part of the timeline; what is seen follows the moment.
  let zoom = 1;
  let from = 0;
  let start = "";
  let duration = "";
  let of = ""; // whose axis it is
  const look = (newZoom, newFrom) => {
    zoom = Math.min(Math.max(newZoom, 1), 200);
    from = Math.min(Math.max(newFrom, 0), 1 - 1 / zoom);
    const root = document.documentElement;
    root.style.setProperty("--zoom", zoom);
    root.style.setProperty("--from", from);
    root.classList.toggle("etv-zoomed", zoom > 1.01);
    drawRuler();
  };
  const head = () => Number.parseFloat(document.querySelector(".et-axis > .et-head-line")?.style.getPropertyValue("--x")) / 100 || 0;
  const drawRuler = () => {
    const ruler = document.querySelector(".etv-ruler");
    if (!ruler) return;
    const total = Number(duration);
    const begin = Number(start) + from * total; // a live axis does not begin at 0
    if (zoom <= 1.01 || !total) {
      ruler.replaceChildren();
      return;
    }
    const seen = total / zoom;
    const rough = seen / Math.max(ruler.clientWidth / 140, 2);
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
    const digits = Math.max(0, -Math.floor(Math.log10(step)));
    const labels = [];
    for (let at = Math.ceil(begin / step) * step; at <= begin + seen; at += step) {
      const label = document.createElement("span");
      label.textContent = `${at.toFixed(digits)} s`;
      label.style.left = `${(100 * (at - begin)) / seen}%`;
      labels.push(label);
    }
    ruler.replaceChildren(...labels);
  };
  document.addEventListener(
    "wheel",
    (event) => {
      const strip = event.target.closest?.(".et-strip");
      if (!strip) return;
      event.preventDefault();
      const box = strip.getBoundingClientRect();
      const at = (event.clientX - box.left) / box.width;
      if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) look(zoom, from + (event.deltaX || event.deltaY) / box.width / zoom);
      else {
        const closer = Math.min(Math.max(zoom * Math.exp(-event.deltaY / 300), 1), 200);
        look(closer, from + at / zoom - at / closer);
      }
    },
    { passive: false },
  );
  const around = (factor) => {
    const at = Math.min(Math.max((head() - from) * zoom, 0), 1);
    look(zoom * factor, head() - at / Math.min(Math.max(zoom * factor, 1), 200));
  };
  const lookKeys = {
    "+": () => around(1.5),
    "=": () => around(1.5),
    "-": () => around(1 / 1.5),
    0: () => look(1, 0),
    "[": () => look(zoom, from - 0.25 / zoom),
    "]": () => look(zoom, from + 0.25 / zoom),
  };
  let headWas = 0;
  // A recording that grows, or of which a live buffer drops the oldest, has another axis: what is looked at stays, while there
  // is something left of it.
  const onto = (now) => {
    const former = { start: Number(start), duration: Number(duration) };
    const stays = of === (now.of ?? "") && zoom > 1.01 && former.duration > 0 && Number(now.duration) > 0;
    const isAsLong = duration === (now.duration ?? "");
    [start, duration, of] = [now.start ?? "", now.duration ?? "", now.of ?? ""];
    if (!stays) return isAsLong ? drawRuler() : look(1, 0);
    const placed = (share) => (former.start + share * former.duration - Number(start)) / Number(duration);
    look((zoom * Number(duration)) / former.duration, placed(from + 1 / zoom) > 0 ? placed(from) : from);
    headWas = Math.abs(head() - placed(headWas)) < 2e-5 ? head() : placed(headWas); // told to 1e-5: where it is the same, time stood still
  };
  setInterval(() => {
    const now = document.querySelector(".et-axis")?.dataset ?? {};
    if (start !== (now.start ?? "") || duration !== (now.duration ?? "")) onto(now);
    const at = head();
    if (zoom > 1.01 && at !== headWas && !held && (at < from || at > from + 1 / zoom)) look(zoom, at - 0.1 / zoom);
    headWas = at;
  }, 150);

  // In public the show lets go of the page at the first touch, wherever it is, be it on the picture before the page.
  let touched = 0;
  const touch = (event) => {
    if (!event.isTrusted || event.timeStamp - touched < 500 || !document.querySelector("[data-etv-public], .etv-opening")) return;
    touched = event.timeStamp;
    say("touch");
  };
  for (const kind of ["pointerdown", "keydown", "wheel"]) {
    document.addEventListener(kind, touch, { capture: true, passive: true });
  }

  // Small selects and numbers of our own: what is chosen is a key with the choice at its end.
  document.addEventListener("change", (event) => {
    const key = event.target.dataset?.set;
    if (!key || event.target.value === "") return;
    say("pick", `${key}:${event.target.value.replaceAll("|", "")}`, 0, 0);
    event.target.blur();
  });

  // Keys that viser's commands do not know. Not while something is being typed. Arrows step, and never move the camera
  // of the scene: they are taken before it hears them; a slider or a row of buttons that has the focus keeps them.
  const keys = { ",": "comma", ".": "period", "?": "question" };
  const arrows = { ArrowLeft: "left", ArrowRight: "right" };
  const isTyping = (event) => event.target.closest?.("input:not([type=checkbox]), textarea, [contenteditable=true]");
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
      if (event.target.closest?.("[role=slider], [role=radiogroup], [role=listbox], [role=menu], [role=tablist], select")) return;
      // In the demo arrows move the spot (demo_keys.js); a map that has the focus has its keys (keys.js).
      if (/^Arrow/.test(event.key) && document.querySelector('[data-etv-workspace="demo"]')) return;
      const isOnMap = document.documentElement.hasAttribute("data-etv-map-focus") && document.querySelector("[data-etv-query]");
      if (isOnMap && /^(Arrow.*|[0-9[\]])$/.test(event.key)) return;
      if (arrows[event.key]) {
        event.preventDefault();
        event.stopImmediatePropagation();
        say("key", event.shiftKey ? `far-${arrows[event.key]}` : arrows[event.key]);
      } else if (event.key === "ArrowUp" || event.key === "ArrowDown") event.stopImmediatePropagation();
      else if (keys[event.key]) say("key", keys[event.key]);
      else if (lookKeys[event.key] && document.querySelector(".et-axis")) lookKeys[event.key]();
    },
    { capture: true },
  );
  // A field that was used gives the keys back: after a choice from a list, after Enter, after a click elsewhere.
  const giveBack = () => document.activeElement?.matches?.("input, textarea") && document.activeElement.blur();
  document.addEventListener("click", (event) => {
    if (event.target.closest?.("[role=option]")) setTimeout(giveBack, 60);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target.matches?.("input:not([type=search])")) setTimeout(giveBack, 60);
    if (event.key === "Enter" && event.target.matches?.("[role=combobox], [aria-haspopup=listbox]")) setTimeout(giveBack, 60);
  });

  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => say("size", ...size()), 150);
  });

  // The list of recordings: what is typed leaves out what does not match; a choice, Escape or a click elsewhere closes it.
  // The bar that holds it is drawn again and again: an open list stays open, where it was scrolled to, with what was typed.
  const list = () => document.querySelector(".etv-recordings[open]");
  const shut = (open) => {
    open.open = false;
    window.etnetFocus.forget();
    if (open.contains(document.activeElement)) document.activeElement.blur(); // the page has the keys again, at once
  };
  const sift = (rows, typed) => {
    const words = typed.toLowerCase().split(" ");
    for (const row of rows.querySelectorAll("button")) row.hidden = !words.every((word) => row.innerText.toLowerCase().includes(word));
  };
  const kept = { node: null, top: 0, typed: "" };
  document.addEventListener("input", (event) => {
    const rows = event.target.closest?.(".etv-list");
    if (!rows) return;
    kept.typed = event.target.value;
    sift(rows, kept.typed);
  });
  document.addEventListener("scroll", (event) => {
    if (event.target.matches?.(".etv-list")) kept.top = event.target.scrollTop;
  }, { capture: true, passive: true });
  new MutationObserver(() => {
    const node = document.querySelector(".etv-recordings");
    if (!node || node === kept.node) return void window.etnetFocus.again();
    const hadFocus = document.activeElement === document.body;
    const wasOpen = kept.node?.open;
    kept.node = node;
    if (!wasOpen) {
      kept.typed = "";
      return void window.etnetFocus.again();
    }
    node.open = true;
    const rows = node.querySelector(".etv-list");
    const field = rows.querySelector("input");
    field.value = kept.typed;
    if (kept.typed) sift(rows, kept.typed);
    rows.scrollTop = kept.top;
    if (hadFocus && !window.etnetFocus.again()) field.focus({ preventScroll: true });
  }).observe(document.body, { childList: true, subtree: true });
  document.addEventListener("click", (event) => {
    const open = list();
    if (!open && event.target.closest?.(".etv-recordings summary")) {
      event.preventDefault(); // opened here and not by the browser after this: what is typed next goes into the search
      kept.node.open = true;
      kept.node.querySelector("input").focus({ preventScroll: true });
    } else if (open && (!open.contains(event.target) || event.target.closest("[data-k]"))) shut(open);
    else if (open) open.querySelector("input").focus({ preventScroll: true });
  });
  // Escape closes what lies over the page: the list, else help and the other windows of viser; so does a click beside them.
  const closeWindow = () => {
    const buttons = [...document.querySelectorAll(".mantine-Modal-content button, .mantine-Modal-header button")];
    buttons.find((button) => button.innerText.trim() === "Close" || button.classList.contains("mantine-Modal-close"))?.click();
  };
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    if (list()) shut(list());
    else closeWindow();
  });
  document.addEventListener("mousedown", (event) => {
    if (event.target.matches?.(".mantine-Modal-overlay, .mantine-Modal-inner")) closeWindow();
  });

  // A server that does not answer is said in a sentence; once it answers again the page is loaded, and is where it was.
  const lost = document.createElement("div");
  lost.className = "etv-lost";
  lost.setAttribute("role", "alert");
  lost.hidden = true;
  lost.textContent = "The viewer does not answer: it was stopped, or the connection is gone. This page returns by itself as soon as it is back.";
  document.body.append(lost);
  let misses = 0;
  setInterval(async () => {
    if (document.visibilityState !== "visible" || !window.etnetChannel) return;
    try {
      await fetch("/static/icon.svg", { cache: "no-store", signal: AbortSignal.timeout(3000) });
      if (misses >= 2) (window.etnetStartOver ?? (() => location.reload()))();
      misses = 0;
    } catch {
      misses += 1;
      lost.hidden = misses < 2;
      if (misses >= 2) document.dispatchEvent(new Event("etnet-lost"));
    }
  }, 3500);
})();
