// A moment as a link: C copies the address of what is on show. The address that this page was opened by is told
// once; on a reload the page rather returns to where it was.
(() => {
  const say = window.etnetSay;

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
    const keep = () => {
      try {
        sessionStorage.setItem("etnet-moment", moment ?? "");
      } catch {
        // a page that may keep nothing follows its address each time
      }
    };
    let before = null;
    try {
      before = sessionStorage.getItem("etnet-moment");
    } catch {
      // the same
    }
    if (!moment || (kind === "reload" && before === moment)) return void keep();
    // Kept once it is told: a page that found no place among the visitors is loaded anew, and has it to tell then.
    document.addEventListener("etnet-told", ({ detail }) => detail === "link" && keep());
    say("link", moment);
  };
  follow();
})();
