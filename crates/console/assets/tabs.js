// @ts-check
// Accessible tabs: arrow keys move, one panel is shown.

/**
 * @param {HTMLElement} list with elements of role `tab` that control panels by `aria-controls`
 * @param {(name: string) => void} onSelect the tab's `data-tab`
 */
export function tabs(list, onSelect) {
  const all = /** @type {HTMLElement[]} */ ([...list.querySelectorAll("[role=tab]")]);
  const select = (/** @type {HTMLElement} */ chosen) => {
    for (const tab of all) {
      const isChosen = tab === chosen;
      tab.setAttribute("aria-selected", String(isChosen));
      tab.tabIndex = isChosen ? 0 : -1;
      const panel = document.getElementById(tab.getAttribute("aria-controls") ?? "");
      if (panel) panel.hidden = !isChosen;
    }
    onSelect(chosen.dataset.tab ?? "");
  };

  for (const tab of all) tab.addEventListener("click", () => select(tab));
  list.addEventListener("keydown", (event) => {
    const turn = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
    const shown = all.filter((tab) => !tab.hidden);
    const index = shown.findIndex((tab) => tab === document.activeElement);
    if (turn === 0 || index < 0) return;
    event.preventDefault();
    const next = shown[(index + turn + shown.length) % shown.length];
    next.focus();
    select(next);
  });

  return { select: (/** @type {string} */ name) => all.filter((tab) => tab.dataset.tab === name).forEach(select) };
}
