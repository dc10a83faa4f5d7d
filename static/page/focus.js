// While the keyboard is on a button, or on the demo's slider, it stays there, though their HTML is replaced, be it by what
// they did. A button is known again by its key; one whose key says what a press does next ("timeline:loop", then
// "timeline:once") by its key's beginning, its name and its kind.
(() => {
  const shown = (fits) => [...document.querySelectorAll("button[data-pick]")].filter((button) => fits(button) && button.checkVisibility());
  const keyOf = (button) => button.dataset.k;
  const stemOf = (button) => keyOf(button).replace(/[^:]*$/, "");
  const nameOf = (button) => (button.getAttribute("aria-label") ?? button.textContent).split(":")[0].trim(); // "Another scene: Things that roll"
  const kindOf = (button) => [...button.classList].filter((name) => !name.endsWith("-on")).join(" ");

  // The way to find a button again. Of several that say and do the same, one on each card, it is the one in the same place.
  const wayTo = (button) => {
    const [key, stem, name, kind] = [keyOf, stemOf, nameOf, kindOf].map((of) => of(button));
    const hasKey = (other) => keyOf(other) === key;
    const isSame = (other) => hasKey(other) && nameOf(other) === name;
    const isAlike = (other) => stemOf(other) === stem && nameOf(other) === name && kindOf(other) === kind;
    const place = shown(isSame).indexOf(button);
    const isSwitch = shown(isAlike).every(hasKey); // else the key's end says which of them it is: "remove:a", "remove:b"
    return () => {
      for (const fits of isSwitch ? [isSame, isAlike, hasKey] : [isSame, hasKey]) {
        const found = shown(fits);
        if (found.length) return found[place] ?? found[0];
      }
      return undefined;
    };
  };
  const track = () => [...document.querySelectorAll(".etv-track[tabindex]")].find((each) => each.checkVisibility());

  let find = null; // what has the keyboard
  const keep = (element) => {
    if (element.matches?.("button[data-pick]")) find = wayTo(element);
    else find = element.matches?.(".etv-track") ? track : null;
  };
  const forget = () => (find = null);
  const again = () => {
    if (!find || document.activeElement !== document.body) return false;
    const found = find();
    if (!found) return false;
    found.focus({ preventScroll: true });
    keep(found); // its key may be another one now
    return true;
  };
  document.addEventListener("focusin", ({ target }) => (target.matches?.(":focus-visible") ? keep(target) : forget()));
  document.addEventListener("pointerdown", forget, true);
  window.etnetFocus = { again, forget };
})();
