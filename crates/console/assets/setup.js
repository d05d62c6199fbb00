// @ts-check
// The set-up: what a person can change before the next epoch.

import { faultsOf } from "./draft.js";
import { form } from "./setup-form.js";
import { short } from "./units.js";
import { render } from "./vendor/lit-html.js";

/** @typedef {import("./store.js").Store} Store */
/** @typedef {import("./units.js").Units} Units */
/** @typedef {import("./types/messages.js").Setup} Setup */
/** @typedef {import("./types/messages.js").Control} Control */
/** @typedef {import("./types/messages.js").ControlAnswer} ControlAnswer */
/** @typedef {import("./editor.js").Editor} Editor */
/** @typedef {import("./notices.js").Notices} Notices */

/** @typedef {import("./setup-form.js").Kind} Kind */

const LARGEST_FILE = 1 << 20;
const SEED_BITS = 2 ** 32;

export class SetupView {
  /**
   * @param {HTMLElement} place
   * @param {{store: Store, units: Units, editor: Editor, notices: Notices, request: (control: Control) => Promise<ControlAnswer>}} parts
   */
  constructor(place, { store, units, editor, notices, request }) {
    this.place = place;
    this.store = store;
    this.units = units;
    this.editor = editor;
    this.notices = notices;
    this.request = request;
    /** The set-up of the run. @type {Setup | null} */
    this.applied = null;
    /** The set-up as it is edited. @type {Setup | null} */
    this.draft = null;
    /** The text of a field that was edited, by name. @type {Map<string, string>} */
    this.typed = new Map();
    /** Reasons of the simulator's refusal, by field. @type {Map<string, string>} */
    this.refused = new Map();
    this.isOpen = false;
    units.listeners.push(() => {
      this.typed.clear();
      this.render();
    });

    store.on("epoch", () => this.fetch());
    store.on("connection", () => this.fetch());
  }

  get body_m() {
    return this.store.frame?.body_m ?? 0.6096;
  }

  get isChanged() {
    return this.draft !== null && JSON.stringify(this.draft) !== JSON.stringify(this.applied);
  }

  /** Reasons by field. */
  faults() {
    if (!this.draft) return new Map();
    const length = (/** @type {number} */ length_m) => this.units.length(length_m, 2);
    const faults = faultsOf(this.draft, this.body_m, this.store.frame?.tick_s ?? 0, length);

    for (const [field, reason] of this.refused) {
      if (!faults.has(field)) faults.set(field, reason);
    }
    return faults;
  }

  /** @param {boolean} isOpen */
  open(isOpen) {
    this.isOpen = isOpen;
    if (isOpen && !this.draft) this.fetch();
    this.changed();
  }

  /** Requests the set-up of the run, unless there are unapplied changes. */
  async fetch() {
    if (!this.isOpen || !this.store.isLive || this.isChanged) return this.changed();
    await this.refresh();
  }

  /** Replaces the draft with the set-up of the run. */
  async refresh() {
    const answer = await this.request({ do: "setup" });
    if (answer.answer === "setup") this.take(answer.setup);
    else if (answer.answer === "refused") this.notices.show(answer);
  }

  /** @param {Setup} setup */
  take(setup) {
    this.applied = setup;
    this.draft = structuredClone(setup);
    this.typed.clear();
    this.refused.clear();
    this.changed();
  }

  /** Shows the draft in the form, and on the plan unless the clock runs. */
  changed() {
    const isEdited = this.isOpen && this.store.mode === "live" && this.store.phase !== "running";
    this.editor.draft = isEdited ? this.draft : null;
    this.editor.isAsApplied = !this.isChanged;
    this.render();
    this.onChange();
  }

  /** To be called when the phase may have changed. */
  phase() {
    const isRunning = this.store.phase === "running";
    if (this.isOpen && isRunning === (this.editor.draft !== null)) this.changed();
  }

  /** To be called when the draft was edited on the plan. */
  moved() {
    for (const name of this.typed.keys()) {
      if (name.startsWith("robot-")) this.typed.delete(name);
    }
    this.changed();
  }

  /** Called after every change; set by the page. */
  onChange() {}

  render() {
    if (this.isOpen) render(form(this, this.faults()), this.place);
  }

  /**
   * The text of a field.
   * @param {string} name
   * @param {number} value
   * @param {Kind} kind
   */
  text(name, value, kind) {
    const typed = this.typed.get(name);
    if (typed !== undefined) return typed;
    return kind === "length" ? short(value / this.units.unit_m, 4) : String(value);
  }

  /**
   * Parses the text of a field; NaN if it is not a number, which the checks report.
   * @param {string} name
   * @param {string} text
   * @param {Kind} kind
   */
  number(name, text, kind) {
    this.typed.set(name, text);
    const trimmed = text.trim().replace(",", ".");
    const value = trimmed === "" ? NaN : Number(trimmed);
    return kind === "length" ? Number((value * this.units.unit_m).toFixed(6)) : value;
  }

  /**
   * @param {string} field whose refusal is cleared
   * @param {(draft: Setup) => void} change
   */
  edit(field, change) {
    if (!this.draft) return;
    this.refused.delete(field);
    change(this.draft);
    this.changed();
  }

  async apply() {
    const { draft } = this;
    if (!draft) return;

    this.refused.clear();
    const faults = this.faults();
    if (faults.size > 0) {
      this.notices.refusal(`Not applied: ${[...faults.values()][0]}`);
      return this.showFirstFault();
    }

    const answer = await this.request({ do: "init", setup: draft });
    if (answer.answer === "refused") {
      this.refused = new Map((answer.fields ?? []).map(({ field, reason }) => [field, reason]));
      this.notices.show(answer);
      this.changed();
      return this.showFirstFault();
    }

    this.notices.note("Applied: the next epoch is ready at tick 0.");
    await this.refresh();
  }

  showFirstFault() {
    const shown = this.place.querySelector(".fault:not(:empty)");
    shown?.scrollIntoView({ block: "nearest" });
  }

  async save() {
    const answer = await this.request({ do: "setup" });
    if (answer.answer !== "setup") return this.notices.show(answer);

    const anchor = document.createElement("a");
    anchor.href = URL.createObjectURL(new Blob([answer.scenario], { type: "application/toml" }));
    anchor.download = `${this.store.run || "scenario"}.toml`;
    anchor.click();
    URL.revokeObjectURL(anchor.href);
    this.notices.note(this.isChanged ? "Saved without the changes that are not applied." : "Saved.");
  }

  /** @param {File} file */
  async load(file) {
    if (file.size > LARGEST_FILE) return this.notices.refusal(`${file.name} is larger than a scenario can be (1 MiB).`);
    const answer = await this.request({ do: "load", scenario: await file.text() });
    if (answer.answer === "refused") return this.notices.refusal(`${file.name}: ${answer.explanation}`);
    this.notices.note(`${file.name} is loaded: the next epoch is ready at tick 0.`);
    await this.refresh();
  }

  drawSeed() {
    const [high, low] = crypto.getRandomValues(new Uint32Array(2));
    this.typed.delete("seed");
    this.edit("seed", (draft) => (draft.seed = (high % 2 ** 21) * SEED_BITS + low));
  }
}
