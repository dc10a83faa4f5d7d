// Takes away what lies over the page and nobody is there to close: viser's remark on a slow machine, and, when the show
// in public starts over, what the last visitor left open. It knows both by what stands in the page.
(() => {
  const STAYS = 8000; // milliseconds in which the remark can be read, by whoever can do something about it
  const leads = () => {
    const mark = document.querySelector("[data-etv-public]");
    return mark !== null && mark.dataset.etvPublic !== "none";
  };
  const started = Date.now();
  const takeRemark = () => {
    if (Date.now() - started < STAYS && !document.querySelector("[data-etv-public]")) return;
    for (const notice of document.querySelectorAll(".mantine-Notification-root")) {
      if (notice.innerText.includes("Software WebGL")) notice.querySelector("button")?.click();
    }
  };

  // Escape closes the tour and the list of commands alike. It is no touch: channel.js passes over what no hand has done.
  let was = leads();
  const takeWhatWasLeft = () => {
    const now = leads();
    if (now && !was) document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", bubbles: true }));
    was = now;
  };
  setInterval(() => {
    takeRemark();
    takeWhatWasLeft();
  }, 250);
})();
