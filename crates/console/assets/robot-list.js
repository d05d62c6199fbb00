// @ts-check
// Many robots, one line each: sorted, filtered by emotion and by text. One click opens a robot's panel.

import { badgeStyle } from "./palette.js";
import { initials } from "./roster.js";
import { html, noChange, nothing, render } from "./vendor/lit-html.js";

/**
 * What a line shows. `badness` tells how much it is held up.
 * @typedef {{name: string, emotion: string, intensity: number | null, behavior: string, held: string, badness: number, isAbsent: boolean}} Line
 */
/** @typedef {"name" | "emotion" | "intensity" | "behavior" | "held"} Column */

/** @type {[Column, string][]} */
const COLUMNS = [
  ["name", "Name"],
  ["emotion", "Emotion"],
  ["intensity", "Intensity"],
  ["behavior", "Behavior"],
  ["held", "Held up"],
];
const NAMES = new Intl.Collator("en", { numeric: true });

export class RobotList {
  /**
   * @param {{choose: (robot: string) => void, changed: () => void}} client
   */
  constructor(client) {
    this.client = client;
    /** @type {Column} */
    this.column = "name";
    this.isReverse = false;
    this.emotion = "";
    this.text = "";
    /** The keys of the lines as they were rendered last, by place. @type {string[]} */
    this.drawn = [];
    this.place = document.createElement("section");
    this.place.className = "robot-list";
    this.place.dataset.testid = "robot-list";
    this.place.setAttribute("aria-label", "All robots");
  }

  /** @param {Column} column A second click turns the order around. */
  sort(column) {
    // What is strongest or worst is looked for first.
    const isNumber = column === "intensity" || column === "held";
    this.isReverse = column === this.column ? !this.isReverse : isNumber;
    this.column = column;
    this.client.changed();
  }

  /** @param {Line[]} lines */
  select(lines) {
    const wanted = this.text.trim().toLowerCase();
    const isShown = (/** @type {Line} */ line) =>
      (this.emotion === "" || line.emotion === this.emotion) &&
      (wanted === "" || [line.name, line.emotion, line.behavior, line.held].some((word) => word.toLowerCase().includes(wanted)));
    const turn = this.isReverse ? -1 : 1;

    return lines.filter(isShown).sort((a, b) => turn * compare(this.column, a, b) || NAMES.compare(a.name, b.name));
  }

  /**
   * @param {Line[]} lines
   * @param {string | null} open the robot whose panel is open
   */
  render(lines, open) {
    const shown = this.select(lines);
    const count = shown.length === lines.length ? `${lines.length} robots` : `${shown.length} of ${lines.length} robots`;
    const counts = new Map();
    for (const { emotion } of lines) counts.set(emotion, (counts.get(emotion) ?? 0) + 1);
    const emotions = [...counts].filter(([name]) => name !== "").sort(([a], [b]) => NAMES.compare(a, b));
    // The choice stays although no robot feels so now.
    if (this.emotion && !counts.has(this.emotion)) emotions.push([this.emotion, 0]);
    // Robots without emotions have no columns and no choice of them.
    const haveEmotions = emotions.length > 0 || lines.some(({ intensity }) => intensity !== null);
    this.place.classList.toggle("without-emotions", !haveEmotions);

    render(
      html`
        <div class="list-bar">
          <label class="field inline"><span>Find</span><input type="text" data-testid="list-find" placeholder="name, behavior …"
            .value=${this.text} @input=${(/** @type {Event} */ event) => this.filter("text", event)} /></label>
          <label class="field inline emotion"><span>Emotion</span>
            <select data-testid="list-emotion" @change=${(/** @type {Event} */ event) => this.filter("emotion", event)}>
              <option value="" ?selected=${this.emotion === ""}>all</option>
              ${emotions.map(([name, many]) => html`<option value=${name} ?selected=${name === this.emotion}>${name} (${many})</option>`)}
            </select></label>
          <span class="muted" data-testid="list-count" role="status">${count}</span>
        </div>
        <div class="list-head" role="group" aria-label="Sort by">${COLUMNS.map(([column, word]) => this.head(column, word))}</div>
        <ul class="list-lines" data-testid="list-lines">${shown.map((line, i) => this.line(line, i, open))}</ul>
        ${shown.length ? nothing : html`<p class="muted list-none">No robot is like this now.</p>`}`,
      this.place,
    );
    this.drawn.length = shown.length;
  }

  /**
   * @param {"text" | "emotion"} what
   * @param {Event} event
   */
  filter(what, event) {
    this[what] = /** @type {HTMLInputElement | HTMLSelectElement} */ (event.target).value;
    this.client.changed();
  }

  /**
   * @param {Column} column
   * @param {string} word
   */
  head(column, word) {
    const isSorted = column === this.column;
    const arrow = isSorted ? (this.isReverse ? "↓" : "↑") : "";
    return html`<button type="button" class="${column} ${isSorted ? "sorted" : ""}" data-testid="sort-${column}" aria-pressed=${isSorted}
      @click=${() => this.sort(column)}>${word}<span aria-hidden="true">${arrow}</span></button>`;
  }

  /**
   * @param {Line} line
   * @param {number} at its place
   * @param {string | null} open
   */
  line(line, at, open) {
    const { name, emotion, intensity, behavior, held, isAbsent } = line;
    const isOpen = name === open;
    const style = badgeStyle("emotion", emotion);
    const part = intensity === null ? "" : intensity.toFixed(2);
    const key = [name, initials(name), emotion, style, part, behavior, held, isAbsent, isOpen].join("\n");
    // What has not changed is not rendered again.
    if (this.drawn[at] === key) return noChange;
    this.drawn[at] = key;

    return html`<li><button type="button" class="list-line" data-testid="line-${name}" aria-pressed=${isOpen}
      @click=${() => this.client.choose(name)}>
      <span class="name"><span class="initials ${isAbsent ? "absent" : ""} ${initials(name).length > 2 ? "three" : ""}" aria-hidden="true">${initials(name)}</span><span class="full">${name}</span></span>
      <span class="emotion">${emotion ? html`<span class="badge state" .style=${style}>${emotion}</span>` : "–"}</span>
      <span class="intensity">${part === "" ? "–" : html`<svg viewBox="0 0 1 1" preserveAspectRatio="none" aria-hidden="true"><rect class="rail"
        width="1" height="1"></rect><rect class="level" width=${part} height="1"></rect></svg>${part}`}</span>
      <span class="behavior">${behavior || "–"}</span>
      <span class="held">${held}</span></button></li>`;
  }
}

/** @type {(column: Column, a: Line, b: Line) => number} */
function compare(column, a, b) {
  if (column === "held") return a.badness - b.badness;
  if (column === "intensity") return (a.intensity ?? -1) - (b.intensity ?? -1);
  return NAMES.compare(a[column], b[column]);
}
