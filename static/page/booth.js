// What makes a page in public one that nobody can break: when the show starts over the page is loaded anew, a lost
// connection is waited for with a sentence, and what is viser's own (its list of commands) does not open.
(() => {
  const LOST = 2500; // milliseconds without a page after which the connection counts as lost
  const AGAIN = 2000;
  const mark = () => document.querySelector("[data-etv-public]");
  let isPublic = false; // once public, always
  let led = null;
  let channel = null; // the session's that this page shows
  let seenAt = Date.now();
  let cover = null;
  // The next visitor finds neither what the last one's page kept nor the moment that an address of theirs named.
  const reload = () => {
    try {
      localStorage.clear();
      sessionStorage.clear();
    } catch {
      // a page that may keep nothing has kept nothing
    }
    const address = new URL(location.href);
    address.searchParams.delete("moment");
    if (address.href === location.href) location.reload();
    else location.replace(address);
  };

  // A page that is loaded while the server is not there would be a browser's error, and stay one.
  const isThere = async () => {
    try {
      return (await fetch("/healthz", { cache: "no-store" })).ok;
    } catch {
      return false;
    }
  };
  const wait = async () => {
    if (cover) return;
    cover = document.createElement("div");
    cover.className = "etv-booth-lost";
    cover.dataset.testid = "lost";
    cover.setAttribute("role", "status");
    cover.textContent = "The connection was lost. The show goes on in a moment.";
    document.body.append(cover);
    for (;;) {
      await new Promise((next) => setTimeout(next, AGAIN));
      if (await isThere()) return reload();
    }
  };

  setInterval(() => {
    const now = mark();
    if (now) {
      isPublic = true;
      window.etnetStartOver = reload;
      seenAt = Date.now();
      const leads = now.dataset.etvPublic !== "none";
      const isAnother = channel !== null && channel !== window.etnetChannel; // the connection was cut, and is back
      if ((leads && led === false) || isAnother) reload(); // a visitor has gone: nothing of theirs survives
      led = leads;
      channel = window.etnetChannel ?? null;
    }
    if (isPublic && Date.now() - seenAt > LOST) wait();
  }, 250);

  document.addEventListener("etnet-lost", () => isPublic && wait()); // the page stands, its server is gone

  // viser's list of commands, its own menus and the browser's are not for the public.
  window.addEventListener(
    "keydown",
    (event) => {
      const opens = (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "k";
      if (isPublic && opens) {
        event.preventDefault();
        event.stopImmediatePropagation();
      }
    },
    { capture: true },
  );
  window.addEventListener("contextmenu", (event) => isPublic && event.preventDefault());

  // A page that found no place looks again, each after a time of its own, so that all who wait do not come at once.
  const looksAgain = 20000 + 20000 * Math.random();
  setInterval(async () => {
    if (document.querySelector(".etv-crowded") && (await isThere())) location.reload();
  }, looksAgain);
})();
