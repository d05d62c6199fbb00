// @ts-check
// The set-up form: what a person can change before the next epoch.

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

/** How numbers are typed: as they are, or in the reader's unit of length. @typedef {"plain" | "length"} Kind */

const LARGEST_FILE = 1 << 20;
const SEED_BITS = 2 ** 32;

export class SetupView {
  /**
   * @param {HTMLElement} place
   * @param {{store: Store, units: Units, editor: Editor, notices: Notices, ask: (control: Control) => Promise<ControlAnswer>}} parts
   */
  constructor(place, { store, units, editor, notices, ask }) {
    this.place = place;
    this.store = store;
    this.units = units;
    this.editor = editor;
    this.notices = notices;
    this.ask = ask;
    /** What the run is set up with now. @type {Setup | null} */
    this.applied = null;
    /** What is being made of it. @type {Setup | null} */
    this.draft = null;
    /** What stands in a field while it is typed, by name. @type {Map<string, string>} */
    this.typed = new Map();
    /** What the simulator refused. @type {Map<string, string>} */
    this.refused = new Map();
    this.isOpen = false;
    units.listeners.push(() => {
      this.typed.clear();
      this.render();
    });
    store.on("epoch", () => this.fetch());
    store.on("link", () => this.fetch());
  }

  get body_m() {
    return this.store.frame?.body_m ?? 0.6096;
  }

  get isChanged() {
    return this.draft !== null && JSON.stringify(this.draft) !== JSON.stringify(this.applied);
  }

  /** What is wrong, by field. */
  faults() {
    if (!this.draft) return new Map();
    const length = (/** @type {number} */ length_m) => this.units.length(length_m, 2);
    const faults = faultsOf(this.draft, this.body_m, this.store.frame?.tick_s ?? 0, length);
    for (const [field, reason] of this.refused) if (!faults.has(field)) faults.set(field, reason);
    return faults;
  }

  /** @param {boolean} isOpen */
  open(isOpen) {
    this.isOpen = isOpen;
    if (isOpen && !this.draft) this.fetch();
    this.changed();
  }

  /** Asks what the run is set up with, unless the reader is in the middle of changing it. */
  async fetch() {
    if (!this.isOpen || !this.store.isLive || this.isChanged) return this.changed();
    await this.refresh();
  }

  /** What was changed here is applied or dropped: begins from what the run is set up with. */
  async refresh() {
    const answer = await this.ask({ do: "setup" });
    if (answer.answer === "setup") this.take(answer.setup);
    else if (answer.answer === "refused") this.notices.tell(answer);
  }

  /** @param {Setup} setup */
  take(setup) {
    this.applied = setup;
    this.draft = structuredClone(setup);
    this.typed.clear();
    this.refused.clear();
    this.changed();
  }

  /** Shows the draft in the form, and on the plan unless the run is to be seen there. */
  changed() {
    const isEdited = this.isOpen && this.store.mode === "live" && this.store.phase !== "running";
    this.editor.draft = isEdited ? this.draft : null;
    this.editor.isAsApplied = !this.isChanged;
    this.render();
    this.onChange();
  }

  /** The run began or came to a halt. */
  phase() {
    const isRunning = this.store.phase === "running";
    if (this.isOpen && isRunning === (this.editor.draft !== null)) this.changed();
  }

  /** Something was moved on the plan: its fields show where to. */
  moved() {
    for (const name of this.typed.keys()) if (name.startsWith("robot-")) this.typed.delete(name);
    this.changed();
  }

  /** Set by the page: the plan shows the draft. */
  onChange() {}

  render() {
    if (this.isOpen) render(form(this, this.faults()), this.place);
  }

  /**
   * A field as it is shown.
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
   * What was typed; nonsense becomes NaN, which the checks explain.
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
   * @param {string} field whose old refusal does not hold any longer
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
    const answer = await this.ask({ do: "init", setup: draft });
    if (answer.answer === "refused") {
      this.refused = new Map((answer.fields ?? []).map(({ field, reason }) => [field, reason]));
      this.notices.tell(answer);
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
    const answer = await this.ask({ do: "setup" });
    if (answer.answer !== "setup") return this.notices.tell(answer);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([answer.scenario], { type: "application/toml" }));
    link.download = `${this.store.run || "scenario"}.toml`;
    link.click();
    URL.revokeObjectURL(link.href);
    this.notices.note(this.isChanged ? "Saved as applied; what is changed here is not applied yet." : "Saved.");
  }

  /** @param {File} file */
  async load(file) {
    if (file.size > LARGEST_FILE) return this.notices.refusal(`${file.name} is larger than a scenario can be (1 MiB).`);
    const answer = await this.ask({ do: "load", scenario: await file.text() });
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
