// @ts-check
// The set-up: what a person can change before the next epoch.

import { faultsOf } from "./draft.js";
import { form } from "./setup-form.js";
import { Undo } from "./undo.js";
import { inUnit, short } from "./units.js";
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
   * @param {{store: Store, units: Units, editor: Editor, notices: Notices, request: (control: Control) => Promise<ControlAnswer>,
   *   askToEnd: (label: string, back: string, act: () => void) => void}} parts what `askToEnd` does, is done once a run in progress may end
   */
  constructor(place, { store, units, editor, notices, request, askToEnd }) {
    this.place = place;
    this.store = store;
    this.units = units;
    this.editor = editor;
    this.notices = notices;
    this.request = request;
    this.askToEnd = askToEnd;
    /** The set-up of the run. @type {Setup | null} */
    this.applied = null;
    /** The set-up as it is edited. @type {Setup | null} */
    this.draft = null;
    /** The epoch that has the applied set-up. */
    this.epoch = 0;
    this.undo = new Undo();
    /** The text of a field that was edited, by name. @type {Map<string, string>} */
    this.typed = new Map();
    /** Reasons of the simulator's refusal, by field. @type {Map<string, string>} */
    this.refused = new Map();
    this.isOpen = false;
    units.listeners.push(() => {
      this.typed.clear();
      this.render();
    });
    document.addEventListener("keydown", (event) => this.key(event));

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

  /** Whether another set-up has been applied since this one was edited: another browser, or `cars ctl`. */
  get isOvertaken() {
    return this.isChanged && this.store.isLive && this.nowEpoch > this.epoch;
  }

  get nowEpoch() {
    return Math.max(this.store.status?.epoch ?? 0, this.store.frame?.epoch ?? 0);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (!this.isOpen || !(event.ctrlKey || event.metaKey) || event.altKey) return;
    const key = event.key.toLowerCase();
    const isBack = key === "z" && !event.shiftKey;
    const isForward = key === "y" || (key === "z" && event.shiftKey);
    if (!isBack && !isForward) return;
    event.preventDefault();
    this.step(isBack);
  }

  /** Undoes an edit, or does it again. @param {boolean} isBack */
  step(isBack) {
    const draft = /** @type {Setup | null} */ (isBack ? this.undo.back() : this.undo.forward());
    if (!draft) return;
    this.draft = draft;
    this.typed.clear();
    this.refused.clear();
    this.changed();
  }

  /** Gives the changes up: the draft is the set-up of the run again. */
  revert() {
    if (this.isOvertaken || !this.applied) return this.refresh();
    this.draft = structuredClone(this.applied);
    this.undo.note(this.draft, "", performance.now());
    this.typed.clear();
    this.refused.clear();
    this.changed();
  }

  /** Keeps the changes although another set-up has been applied meanwhile. */
  async keepMine() {
    const applied = await this.ask();
    if (!applied) return;
    this.applied = applied.setup;
    this.epoch = applied.epoch;
    this.changed();
  }

  /** The set-up of the run, and its epoch or an earlier one: then it is requested once more when the epoch is seen. */
  async ask() {
    const status = await this.request({ do: "status" });
    const answer = await this.request({ do: "setup" });
    if (answer.answer === "setup" && status.answer === "done") return { setup: answer.setup, epoch: status.epoch };
    this.notices.show(status.answer === "refused" ? status : answer);
    return null;
  }

  /** Shows the set-up of the run. Changes of it are kept, and are changes of the new epoch if that has the same set-up. */
  async fetch() {
    if (!this.isOpen || !this.store.isLive) return this.changed();
    const applied = await this.ask();
    if (!applied) return;
    if (!this.isChanged) return this.take(applied.setup, applied.epoch);

    if (JSON.stringify(applied.setup) === JSON.stringify(this.applied)) this.epoch = applied.epoch;
    this.changed();
  }

  /** Replaces the draft with the set-up of the run, unless the draft is edited before the answer comes. */
  async refresh() {
    const asked = JSON.stringify(this.draft);
    const applied = await this.ask();
    if (!applied) return;
    if (JSON.stringify(this.draft) === asked) return this.take(applied.setup, applied.epoch);

    // The edit changes what has just been applied. If not, the set-up was overtaken.
    if (JSON.stringify(applied.setup) === asked) {
      this.applied = applied.setup;
      this.epoch = applied.epoch;
    }
    this.changed();
  }

  /**
   * @param {Setup} setup
   * @param {number} epoch
   */
  take(setup, epoch) {
    this.applied = setup;
    this.epoch = epoch;
    this.draft = structuredClone(setup);
    this.undo.begin(setup);
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

  /** To be called when the draft was edited on the plan. What belongs to one drag is one step. */
  moved(what = "") {
    this.undo.note(this.draft, what, performance.now());
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
    return kind === "length" ? value * this.units.unit_m : value;
  }

  /**
   * @param {string} field whose refusal is cleared
   * @param {(draft: Setup) => void} change
   */
  edit(field, change) {
    if (!this.draft) return;
    this.refused.delete(field);
    change(this.draft);
    this.undo.note(this.draft, field, performance.now());
    this.changed();
  }

  /** Begins the next epoch with the draft, once a run in progress may end. */
  begin() {
    if (this.isOvertaken || this.faults().size > 0) this.apply();
    else this.askToEnd("End it and begin again", "", () => this.apply());
  }

  /** Begins the next epoch with the draft; resolves with whether that was accepted. */
  async apply() {
    const { draft } = this;
    if (!draft) return false;
    if (this.isOvertaken) {
      this.notices.refusal("Not applied: another set-up has been applied meanwhile. Choose one of both first.");
      return false;
    }

    this.refused.clear();
    const faults = this.faults();
    if (faults.size > 0) {
      this.notices.refusal(`Not applied: ${[...faults.values()][0]}`);
      this.showFirstFault();
      return false;
    }

    const answer = await this.request({ do: "init", setup: draft, epoch: this.epoch });
    if (answer.answer === "refused") {
      this.refused = new Map((answer.fields ?? []).map(({ field, reason }) => [field, reason]));
      this.notices.show(answer);
      this.changed();
      this.showFirstFault();
      return false;
    }

    this.notices.note("Applied: the next epoch is ready at tick 0.");
    await this.refresh();
    return true;
  }

  showFirstFault() {
    const shown = this.place.querySelector(".fault:not(:empty)");
    shown?.scrollIntoView({ block: "nearest" });
  }

  async save() {
    const answer = await this.request({ do: "setup" });
    if (answer.answer !== "setup") return this.notices.show(answer);

    const anchor = document.createElement("a");
    anchor.href = URL.createObjectURL(new Blob([inUnit(answer.scenario, this.units)], { type: "application/toml" }));
    anchor.download = `${this.store.run || "scenario"}.toml`;
    anchor.click();
    URL.revokeObjectURL(anchor.href);
    this.notices.note(this.isChanged ? "Saved without the changes that are not applied." : "Saved.");
  }

  /** Begins the next epoch with another scenario, once a run in progress may end. @param {File} file */
  load(file) {
    if (file.size > LARGEST_FILE) return this.notices.refusal(`${file.name} is larger than a scenario can be (1 MiB).`);
    this.askToEnd(`End it and load ${file.name}`, "", () => this.loadNow(file));
  }

  /** @param {File} file */
  async loadNow(file) {
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
